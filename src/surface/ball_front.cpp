#include "surface/ball_front.h"

namespace scanner::surface {

BallFront::BallFront(std::size_t vertices)
    : first_edge_(vertices, kNone), open_edges_(vertices, 0) {
  edges_.reserve(3 * vertices);
  faces_.reserve(2 * vertices);
}

std::uint32_t BallFront::find(std::uint32_t u, std::uint32_t v) const {
  for (std::uint32_t e = first_edge_[u]; e != kNone;) {
    const Edge& edge = edges_[e];
    if (edge.from == u) {
      if (edge.to == v) return e;
      e = edge.next_of_from;
    } else {
      if (edge.from == v) return e;
      e = edge.next_of_to;
    }
  }
  return kNone;
}

bool BallFront::accepts(std::uint32_t from, std::uint32_t to) const {
  const std::uint32_t e = find(from, to);
  return e == kNone || (edges_[e].state != State::kInner && edges_[e].from == to);
}

void BallFront::addEdge(std::uint32_t from, std::uint32_t to, std::uint32_t opposite,
                        const Eigen::Vector3d& center) {
  const std::uint32_t e = find(from, to);
  if (e != kNone) {
    edges_[e].state = State::kInner;
    --open_edges_[from];
    --open_edges_[to];
    return;
  }
  const auto id = static_cast<std::uint32_t>(edges_.size());
  edges_.push_back({from, to, opposite, center, State::kFront, first_edge_[from], first_edge_[to]});
  first_edge_[from] = first_edge_[to] = id;
  ++open_edges_[from];
  ++open_edges_[to];
  queue_.push_back(id);
}

void BallFront::addFace(std::uint32_t a, std::uint32_t b, std::uint32_t c,
                        const Eigen::Vector3d& center) {
  faces_.push_back({a, b, c});
  addEdge(a, b, c, center);
  addEdge(b, c, a, center);
  addEdge(c, a, b, center);
}

bool BallFront::next(std::uint32_t& edge) {
  while (!queue_.empty()) {
    edge = queue_.front();
    queue_.pop_front();
    if (edges_[edge].state == State::kFront) return true;
  }
  return false;
}

void BallFront::reopen(std::uint32_t edge, const Eigen::Vector3d& center) {
  edges_[edge].state = State::kFront;
  edges_[edge].center = center;
  queue_.push_back(edge);
}

}  // namespace scanner::surface
