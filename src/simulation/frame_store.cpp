#include "scanner/simulation/frame_store.h"

#include <algorithm>

namespace scanner::simulation {
namespace {

StereoRadiance converted(const StereoRadiance& radiance, int depth) {
  StereoRadiance out;
  radiance.left.convertTo(out.left, depth);
  radiance.right.convertTo(out.right, depth);
  return out;
}

}  // namespace

FrameStore::FrameStore(const Simulation& simulation)
    : simulation_(simulation),
      views_(static_cast<std::size_t>(simulation.views())),
      worker_([this] { work(); }) {}

FrameStore::~FrameStore() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  news_.notify_all();
  worker_.join();
}

void FrameStore::work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stop_ && next_ < simulation_.views()) {
    const int view = next_++;
    lock.unlock();
    StereoRadiance radiance = converted(simulation_.radiance(view), CV_16F);
    lock.lock();
    views_[static_cast<std::size_t>(view)] = std::move(radiance);
    ++rendered_;
    news_.notify_all();
  }
}

int FrameStore::rendered() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return rendered_;
}

bool FrameStore::has(int view) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return !views_.at(static_cast<std::size_t>(view)).left.empty();
}

bool FrameStore::waitForAll(std::chrono::milliseconds patience) const {
  std::unique_lock<std::mutex> lock(mutex_);
  return news_.wait_for(lock, patience, [&] { return rendered_ == simulation_.views(); });
}

std::optional<StereoFrame> FrameStore::frame(int view, const Exposure& exposure) const {
  std::unique_lock<std::mutex> lock(mutex_);
  const StereoRadiance stored = views_.at(static_cast<std::size_t>(view));
  lock.unlock();
  if (stored.left.empty()) return std::nullopt;
  return simulation_.expose(view, converted(stored, CV_32F), exposure);
}

void FrameStore::skipBefore(int view) {
  const std::lock_guard<std::mutex> lock(mutex_);
  next_ = std::max(next_, view);
}

}  // namespace scanner::simulation
