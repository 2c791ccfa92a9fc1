#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "scanner/core/image.h"
#include "scanner/pipeline/scan_folder.h"

namespace scanner::pipeline {

/// A few small pictures of what the camera saw, for the report: the views at the start and
/// the quarters of a scan whose length nobody knows beforehand. Holds at most some dozens
/// of JPEGs. Deterministic; not thread-safe.
class SamplePictures {
 public:
  /// The next registered view: rectified left picture (CV_8UC3, BGR) and its disparity.
  void add(int index, const cv::Mat& left, const DisparityImage& disparity);

  /// pictures/view_NNN_{left,left_disparity}.jpg of the first, quarter, half and three-quarter
  /// view, as near as they were kept.
  Status write(ScanFolder& folder) const;

 private:
  struct Sample {
    int index = -1;
    std::size_t number = 0;  ///< of the registered views, from 0
    std::string left, disparity;
  };

  std::vector<Sample> samples_;  ///< every stride_-th registered view
  std::size_t stride_ = 1;
  std::size_t seen_ = 0;
};

}  // namespace scanner::pipeline
