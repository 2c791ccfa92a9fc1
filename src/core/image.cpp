#include "scanner/core/image.h"

namespace scanner {

const char* toString(PixelFormat format) {
  switch (format) {
    case PixelFormat::kMono8:
      return "mono8";
    case PixelFormat::kBgr8:
      return "bgr8";
    case PixelFormat::kBayerRggb8:
      return "bayer_rggb8";
    case PixelFormat::kBayerBggr8:
      return "bayer_bggr8";
    case PixelFormat::kBayerGbrg8:
      return "bayer_gbrg8";
    case PixelFormat::kBayerGrbg8:
      return "bayer_grbg8";
  }
  return "unknown";
}

}  // namespace scanner
