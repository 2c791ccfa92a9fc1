#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <std_srvs/Trigger.h>

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "scanner/Save.h"
#include "scanner/core/status.h"

namespace scanner::bridge {

/// Services that may take minutes, on a callback queue and thread of their own: while one runs, the
/// node's topics keep flowing, alone or in a nodelet manager.
class ServiceThread {
 public:
  /// What a service did, or why not; the message goes into the response.
  using Action = std::function<std::pair<bool, std::string>()>;
  using SaveAction = std::function<std::pair<bool, std::string>(const std::string& folder)>;

  explicit ServiceThread(const ros::NodeHandle& nh) : nh_(nh), spinner_(1, &queue_) {
    nh_.setCallbackQueue(&queue_);
  }
  ~ServiceThread() { stop(); }
  ServiceThread(const ServiceThread&) = delete;
  ServiceThread& operator=(const ServiceThread&) = delete;

  void add(const std::string& name, Action action);
  void addSave(const std::string& name, SaveAction action);
  void start() { spinner_.start(); }
  void stop();

 private:
  ros::NodeHandle nh_;
  ros::CallbackQueue queue_;
  std::vector<ros::ServiceServer> servers_;
  ros::AsyncSpinner spinner_;
};

}  // namespace scanner::bridge
