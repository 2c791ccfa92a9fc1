#include "scanner/simulation/renderer.h"
#include "scanner/simulation/rig.h"
#include "scanner/simulation/sensor.h"

namespace scanner::simulation {

void describe(OptionVisitor& v, RigOptions& o) {
  v.option("width_px", o.width_px, {16, 8192}, "px", "of each picture");
  v.option("height_px", o.height_px, {16, 8192}, "px", "of each picture");
  v.option("focal_px", o.focal_px, {100.0, 10000.0}, "px",
           "after rectification, for pictures 1024 pixels wide; scales with the width");
  v.option("baseline_m", o.baseline_m, {0.001, 10.0}, "m", "between the two eyes");
  v.option("distortion", o.distortion, "lenses distort, each in its own way");
  v.option("misalignment", o.misalignment, "the eyes are turned against each other");
}

void describe(OptionVisitor& v, RenderOptions& o) {
  v.option("samples", o.samples, {1, 64}, "", "rays per pixel");
  v.option("adaptive", o.adaptive, "more rays where depth, part or shadow differ within a pixel");
  v.option("shadows", o.shadows, "of the sun");
  v.option("sky_occlusion", o.sky_occlusion, "less sky light in hollows and near the ground");
  v.option("specular", o.specular, "gloss of the sun and the sky");
  v.option("motion_samples", o.motion_samples, {1, 64}, "",
           "poses over the exposure; 1: no motion blur");
  v.option("lens_blur_px", o.lens_blur_px, {0.0, 5.0}, "px",
           "standard deviation of the lens' blur; 0: none");
}

void describe(OptionVisitor& v, SensorOptions& o) {
  v.choice("format", o.format,
           {{"bayer_rggb8", PixelFormat::kBayerRggb8},
            {"bayer_bggr8", PixelFormat::kBayerBggr8},
            {"bayer_gbrg8", PixelFormat::kBayerGbrg8},
            {"bayer_grbg8", PixelFormat::kBayerGrbg8},
            {"bgr8", PixelFormat::kBgr8},
            {"mono8", PixelFormat::kMono8}},
           "what a picture holds");
  v.option("noise", o.noise, "shot noise and read noise");
  v.option("full_well_e", o.full_well_e, {100.0, 1e6}, "e-", "electrons at saturation");
  v.option("read_noise_e", o.read_noise_e, {0.0, 1000.0}, "e-", "standard deviation");
  v.option("vignetting", o.vignetting, {0.0, 0.9}, "", "loss of light in the corners");
  v.option("radiance_e_per_s", o.radiance_e_per_s, {1.0, 1e9}, "e-/s",
           "electrons per second for white paper in the sun");
  v.option("exposure_s", o.exposure_s, {1e-6, 1.0}, "s", "unless it is metered");
  v.option("gain_db", o.gain_db, {0.0, 48.0}, "dB", "of the amplifier");
  v.option("auto_exposure", o.auto_exposure, "exposure metered on the first picture, then kept");
}

}  // namespace scanner::simulation
