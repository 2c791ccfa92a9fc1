#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace scanner::bridge {

/// One worker thread and an unbounded queue, so that callbacks return at once and nothing recorded
/// is lost; the length is there to be reported. Thread-safe.
template <typename Item>
class WorkQueue {
 public:
  explicit WorkQueue(std::function<void(Item&)> work)
      : work_(std::move(work)), thread_([this] { run(); }) {}
  ~WorkQueue() { stop(); }
  WorkQueue(const WorkQueue&) = delete;
  WorkQueue& operator=(const WorkQueue&) = delete;

  void push(Item item) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      items_.push_back(std::move(item));
    }
    wake_.notify_one();
  }

  /// Items waiting or being worked on.
  std::size_t size() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return items_.size() + (busy_ ? 1 : 0);
  }

  /// Ends after the current item; what waits is dropped.
  void stop() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    if (thread_.joinable()) thread_.join();
  }

 private:
  void run() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (true) {
      wake_.wait(lock, [this] { return stopping_ || !items_.empty(); });
      if (stopping_) return;
      Item item = std::move(items_.front());
      items_.pop_front();
      busy_ = true;
      lock.unlock();
      work_(item);
      lock.lock();
      busy_ = false;
    }
  }

  std::function<void(Item&)> work_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Item> items_;
  bool busy_ = false;
  bool stopping_ = false;
  std::thread thread_;  ///< last, so that it starts when all else is there
};

}  // namespace scanner::bridge
