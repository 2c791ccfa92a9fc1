#include "ros/static_broadcast.h"

namespace scanner::bridge {

std::shared_ptr<StaticBroadcast> StaticBroadcast::shared() {
  static std::mutex mutex;
  static std::weak_ptr<StaticBroadcast> existing;
  const std::lock_guard<std::mutex> lock(mutex);
  std::shared_ptr<StaticBroadcast> broadcast = existing.lock();
  if (!broadcast) {
    broadcast = std::make_shared<StaticBroadcast>();
    existing = broadcast;
  }
  return broadcast;
}

void StaticBroadcast::send(const std::vector<geometry_msgs::TransformStamped>& transforms) {
  const std::lock_guard<std::mutex> lock(mutex_);
  broadcaster_.sendTransform(transforms);
}

}  // namespace scanner::bridge
