#include "scanner/ros/viewfinder_node.h"

#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include <opencv2/imgcodecs.hpp>

#include "ros/diagnostics.h"
#include "scanner/ros/conversions.h"

namespace scanner::bridge {

class ViewfinderNode::Impl {
 public:
  Impl(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
      : diagnostics_(nh, private_nh, "viewfinder",
                     [this](DiagnosticStatus& status) { report(status); }) {
    // cppcheck-suppress useInitializationList
    image_ = nh.advertise<sensor_msgs::Image>("viewfinder/image", 1);
    compressed_ = nh.subscribe("stereo/left/viewfinder/compressed", 1, &Impl::onPicture, this);
  }

 private:
  void onPicture(const sensor_msgs::CompressedImageConstPtr& message) {
    ++received_;
    const cv::Mat picture = cv::imdecode(message->data, cv::IMREAD_COLOR);
    if (picture.empty()) {
      ++broken_;
      return;
    }
    image_.publish(toRos(Image{picture, PixelFormat::kBgr8}, message->header));
  }

  void report(DiagnosticStatus& status) const {
    status.summary(kDiagnosticOk, "working");
    if (broken_ > 0) status.summary(kDiagnosticWarn, "pictures could not be unpacked");
    if (received_ == 0) status.summary(kDiagnosticWarn, "no pictures on " + compressed_.getTopic());
    status.add("pictures received", received_);
    status.add("pictures broken", broken_);
  }

  std::size_t received_ = 0, broken_ = 0;
  ros::Publisher image_;
  ros::Subscriber compressed_;
  Diagnostics diagnostics_;
};

ViewfinderNode::ViewfinderNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : impl_(std::make_unique<Impl>(nh, private_nh)) {}
ViewfinderNode::~ViewfinderNode() = default;

}  // namespace scanner::bridge
