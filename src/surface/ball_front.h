#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <deque>
#include <vector>

namespace scanner::surface {

/// Edges of the growing triangulation. Each joins one or two faces, never more, and two faces that
/// share an edge run along it in opposite directions, so the result is an oriented manifold but for
/// vertices where two fans touch.
class BallFront {
 public:
  enum class State : std::uint8_t {
    kFront,     ///< one face, the ball has yet to roll over it
    kBoundary,  ///< one face, the ball found nothing beyond
    kInner      ///< two faces
  };

  struct Edge {
    std::uint32_t from, to;  ///< as its first face runs along it
    std::uint32_t opposite;  ///< third corner of that face
    Eigen::Vector3d center;  ///< of the ball resting on that face
    State state;
    std::uint32_t next_of_from, next_of_to;  ///< lists of the edges of a vertex
  };

  explicit BallFront(std::size_t vertices);

  /// No face uses the vertex yet.
  bool isOrphan(std::uint32_t v) const { return first_edge_[v] == kNone; }
  /// A further face may use the vertex: it is an orphan or lies on the rim of what is there.
  bool isOpen(std::uint32_t v) const { return isOrphan(v) || open_edges_[v] > 0; }
  /// A face running from -> to may be added along this edge.
  bool accepts(std::uint32_t from, std::uint32_t to) const;
  bool exists(std::uint32_t u, std::uint32_t v) const { return find(u, v) != kNone; }

  /// Adds the face (a, b, c) over which a ball rests at `center`. Every edge must be accepted.
  void addFace(std::uint32_t a, std::uint32_t b, std::uint32_t c, const Eigen::Vector3d& center);

  /// Takes the next front edge out of the queue; false when none is left.
  bool next(std::uint32_t& edge);
  void markBoundary(std::uint32_t edge) { edges_[edge].state = State::kBoundary; }
  /// Puts a boundary edge back on the front, with a new ball.
  void reopen(std::uint32_t edge, const Eigen::Vector3d& center);

  const std::vector<Edge>& edges() const { return edges_; }
  const std::vector<std::array<std::uint32_t, 3>>& faces() const { return faces_; }

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  std::uint32_t find(std::uint32_t u, std::uint32_t v) const;
  void addEdge(std::uint32_t from, std::uint32_t to, std::uint32_t opposite,
               const Eigen::Vector3d& center);

  std::vector<Edge> edges_;
  std::vector<std::array<std::uint32_t, 3>> faces_;
  std::vector<std::uint32_t> first_edge_;
  std::vector<std::uint32_t> open_edges_;
  std::deque<std::uint32_t> queue_;
};

}  // namespace scanner::surface
