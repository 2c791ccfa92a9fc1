#include "ros/registration_node_impl.h"

namespace scanner::bridge {
namespace {

constexpr auto kRecheck = std::chrono::milliseconds(100);
/// Pairs that were on their way when ~finish was called have been announced by then.
constexpr auto kSettle = std::chrono::milliseconds(500);

}  // namespace

std::pair<bool, std::string> RegistrationNode::Impl::start() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_ = RegistrationStatus::SCANNING;
    message_.clear();
  }
  publishStatus();
  return {true, "scanning"};
}

std::pair<bool, std::string> RegistrationNode::Impl::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_ = RegistrationStatus::IDLE;
  }
  publishStatus();
  return {true, "stopped; pairs taken so far are still worked off"};
}

std::size_t RegistrationNode::Impl::toCome() const { return announced_.size() + waiting_.size(); }

std::size_t RegistrationNode::Impl::waitForClouds() {
  std::unique_lock<std::mutex> lock(mutex_);
  const auto settled = [this] { return SteadyClock::now() - cloud_news_ > kSettle; };
  while (!stopping_ && (busy_ || toCome() > 0 || !settled())) {
    wake_.wait_for(lock, kRecheck);
    const std::chrono::duration<double> quiet = SteadyClock::now() - news_;
    if (busy_ || toCome() == 0 || quiet.count() < options_.finish_timeout_s) continue;
    if (waiting_.empty()) break;  // announced, but never came
    give_up_ = true;  // samples or tf are missing: the clouds are discarded with that reason
    wake_.notify_all();
  }
  give_up_ = false;
  const std::size_t lost = announced_.size();
  announced_.clear();
  return lost;
}

Trajectory RegistrationNode::Impl::truth() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return truth_;
}

std::pair<bool, std::string> RegistrationNode::Impl::finish() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (state_ == RegistrationStatus::FINISHING) return {false, "already finishing"};
    state_ = RegistrationStatus::FINISHING;
    // A player's clock may lag behind what it plays.
    finish_at_ = std::max(fromRos(ros::Time::now()), newest_sample_.value_or(Time()));
    cloud_news_ = SteadyClock::now();
    message_ = "working off the queue";
  }
  publishStatus();
  const std::size_t lost = waitForClouds();
  const Trajectory truth = this->truth();
  std::string summary;
  bool success = false;
  {
    const std::lock_guard<std::mutex> lock(session_mutex_);
    const registration::GlobalOutcome outcome = session_->finish();
    success = session_->registered() > 0;
    summary = std::to_string(session_->registered()) + " of " + std::to_string(session_->total()) +
              " views registered in " + std::to_string(outcome.groups) + " groups";
    if (lost > 0) {
      const std::string line = std::to_string(lost) + " pairs never came";
      session_->warn(line);
      summary += "; " + line;
    }
    if (!outcome.status) {
      const std::string line = "no global stage: " + outcome.status.message();
      session_->warn(line);
      summary += "; " + line;
    }
    if (folder_) {
      const Status written = session_->save(*folder_, truth);
      if (!written) summary += "; " + written.message();
      success = success && written;
    }
    publishMap(true);
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_ = RegistrationStatus::DONE;
    message_ = summary;
  }
  publishStatus();
  return {success, summary};
}

std::pair<bool, std::string> RegistrationNode::Impl::discardLast() {
  bool success = false;
  {
    const std::lock_guard<std::mutex> lock(session_mutex_);
    success = session_->discardLast();
    if (success) publishMap(true);
  }
  publishStatus();
  return {success, success ? "the newest view is out" : "there is no view to take out"};
}

std::pair<bool, std::string> RegistrationNode::Impl::save(const std::string& path) {
  pipeline::ScanFolder folder(path);
  const Trajectory truth = this->truth();
  const std::lock_guard<std::mutex> lock(session_mutex_);
  const Status status = session_->save(folder, truth);
  if (!status) return {false, status.message()};
  return {true, std::to_string(session_->registered()) + " registered views written to " + path};
}

void RegistrationNode::Impl::report(DiagnosticStatus& status) {
  std::size_t total = 0, registered = 0;
  {
    const std::unique_lock<std::mutex> lock(session_mutex_, std::try_to_lock);
    if (!lock) return status.summary(kDiagnosticOk, "registering");
    total = session_->total();
    registered = session_->registered();
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  status.summary(kDiagnosticOk, "working");
  if (registered < total) status.mergeSummary(kDiagnosticWarn, "views were discarded");
  if (!waiting_for_.empty()) status.summary(kDiagnosticWarn, "waiting: " + waiting_for_);
  if (samples_received_ == 0) {
    status.summary(kDiagnosticError, "no samples on " + imu_sub_.getTopic());
  }
  if (clouds_ == 0) status.summary(kDiagnosticError, "no clouds on " + points_sub_.getTopic());
  if (!message_.empty() && state_ == RegistrationStatus::SCANNING) {
    status.summary(kDiagnosticError, message_);  // the scan folder cannot be written
  }
  status.add("views", total);
  status.add("views registered", registered);
  status.add("clouds received", clouds_);
  status.add("clouds ignored while idle", ignored_);
  status.add("queue length", waiting_.size());
  status.add("inertial samples received", samples_received_);
  status.add("pairs still in stereo", announced_.size());
}

}  // namespace scanner::bridge
