#include "scanner/ros/service_thread.h"

#include <boost/function.hpp>

namespace scanner::bridge {
namespace {

/// A service call always gets an answer: what goes wrong inside becomes its message.
template <typename Response, typename Run>
bool answer(Response& response, const Run& run) {
  bool success = false;
  try {
    std::tie(success, response.message) = run();
  } catch (const std::exception& e) {
    response.message = e.what();
  }
  response.success = success;
  return true;
}

}  // namespace

void ServiceThread::add(const std::string& name, Action action) {
  using Request = std_srvs::Trigger::Request;
  using Response = std_srvs::Trigger::Response;
  const boost::function<bool(Request&, Response&)> callback = [action = std::move(action)](
                                                                  Request&, Response& response) {
    return answer(response, action);
  };
  servers_.push_back(nh_.advertiseService<Request, Response>(name, callback));
}

void ServiceThread::addSave(const std::string& name, SaveAction action) {
  using Request = scanner::Save::Request;
  using Response = scanner::Save::Response;
  const boost::function<bool(Request&, Response&)> callback =
      [action = std::move(action)](Request& request, Response& response) {
        return answer(response, [&] { return action(request.folder); });
      };
  servers_.push_back(nh_.advertiseService<Request, Response>(name, callback));
}

void ServiceThread::stop() {
  servers_.clear();
  spinner_.stop();
}

}  // namespace scanner::bridge
