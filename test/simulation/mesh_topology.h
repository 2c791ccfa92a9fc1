#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "scanner/simulation/scene.h"

namespace scanner::simulation {

struct Topology {
  bool closed_manifold = false;  ///< every edge once in each direction, one fan round every vertex
  long euler = 0;                ///< V - E + F
  double volume = 0.0;
};

/// Faces round each vertex are one fan when walking over shared edges reaches all of them; for a
/// mesh whose edges are all paired that is so when a vertex has as many faces as its walk has
/// steps.
inline Topology topologyOf(const Part& part) {
  Topology t;
  std::vector<std::pair<std::uint64_t, std::uint32_t>>
      edges;  // directed (from, to), opposite corner
  for (const auto& [a, b, c] : part.faces) {
    const std::uint32_t v[3] = {a, b, c};
    for (int i = 0; i < 3; ++i) {
      edges.push_back({std::uint64_t{v[i]} << 32U | v[(i + 1) % 3], v[(i + 2) % 3]});
    }
    t.volume += part.vertices[a].cast<double>().dot(
                    part.vertices[b].cast<double>().cross(part.vertices[c].cast<double>())) /
                6.0;
  }
  std::sort(edges.begin(), edges.end());
  const auto find = [&](std::uint32_t from, std::uint32_t to) {
    const std::uint64_t key = std::uint64_t{from} << 32U | to;
    const auto it = std::lower_bound(edges.begin(), edges.end(), std::make_pair(key, 0U));
    return it != edges.end() && it->first == key ? &*it : nullptr;
  };
  t.closed_manifold = !edges.empty();
  std::vector<std::uint32_t> degree(part.vertices.size(), 0), start(part.vertices.size(), 0);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const auto from = static_cast<std::uint32_t>(edges[i].first >> 32U);
    const auto to = static_cast<std::uint32_t>(edges[i].first);
    if (i > 0 && edges[i].first == edges[i - 1].first) t.closed_manifold = false;
    if (find(to, from) == nullptr) t.closed_manifold = false;
    ++degree[from];
    start[from] = to;
  }
  for (std::uint32_t v = 0; t.closed_manifold && v < part.vertices.size(); ++v) {
    std::uint32_t steps = 0, at = start[v];
    do {
      at = find(v, at)->second;
      ++steps;
    } while (at != start[v] && steps <= degree[v]);
    if (steps != degree[v]) t.closed_manifold = false;
  }
  t.euler = static_cast<long>(part.vertices.size()) - static_cast<long>(edges.size() / 2) +
            static_cast<long>(part.faces.size());
  return t;
}

}  // namespace scanner::simulation
