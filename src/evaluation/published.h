#pragma once

#include <array>

/// What the thesis prints for its artwork sequence (50 views), to stand beside one's own figures.
namespace scanner::evaluation::published {

/// arc, roll, pitch, yaw in degrees, rho, x, y, z in metres.
using Columns = std::array<double, 8>;

struct Motion {
  Columns median, mean, sigma;
};

inline constexpr Motion kTable52 = {
    {8.6054, 0.0028, 8.5741, 1.7563, 0.1031, 0.0970, 0.0027, 0.0115},
    {8.7313, -0.0561, 8.1333, 1.9479, 0.0993, 0.0961, 0.0040, 0.0097},
    {4.4186, 1.0970, 4.3835, 1.7852, 0.0311, 0.0313, 0.0167, 0.0146}};
inline constexpr Motion kTable53 = {
    {7.5161, -0.2684, 0.1222, -0.5404, 0.1031, -0.0199, 0.0154, 0.0033},
    {8.1419, -0.0521, -0.0324, 0.2500, 0.0993, -0.0090, 0.0072, 0.0057},
    {3.6812, 1.5090, 1.7112, 8.0486, 0.0314, 0.0733, 0.0710, 0.0158}};
inline constexpr Motion kTable54 = {
    {10.8663, 0.5512, 0.9658, 11.1292, 0.9942, -0.2216, 0.6607, 0.2012},
    {11.2600, 0.4501, 0.7777, 10.5076, 0.9849, -0.1528, 0.7711, 0.1795},
    {5.1592, 1.2563, 1.3901, 5.4691, 0.4545, 0.4550, 0.5329, 0.0856}};
inline constexpr Motion kTable55 = {
    {8.1235, 0.0, 0.0, 0.0, 0.1034, -0.0199, 0.0148, 0.0035},
    {7.4110, -0.0011, -0.0289, 0.3455, 0.1005, -0.0076, 0.0064, 0.0069},
    {4.0161, 1.5008, 1.6568, 8.1202, 0.0309, 0.0726, 0.0723, 0.0154}};
inline constexpr Motion kTable56 = {
    {12.1638, 0.4862, 0.3832, 11.6797, 0.9718, -0.1996, 0.6493, 0.1971},
    {11.7670, 0.2288, 0.0853, 11.4909, 0.9570, -0.1702, 0.7625, 0.1735},
    {5.6346, 1.4430, 1.4127, 5.6210, 0.4767, 0.4451, 0.5409, 0.0851}};

/// Table 5.1: alignments settled by steps 1 to 8.
inline constexpr std::array<int, 8> kTrials = {5, 122, 12, 10, 17, 6, 18, 0};

/// Table 4.2.
struct Sampling {
  double bucket_deg, buckets, empty, per_bucket, per_bucket_sigma;
};
inline constexpr std::array<Sampling, 5> kSampling = {{{1, 32100, 5633, 7.91, 9.12},
                                                       {5, 1296, 30.5, 151.03, 177.87},
                                                       {10, 324, 1.78, 593.01, 697.30},
                                                       {15, 144, 0.16, 1328.1, 1530.0},
                                                       {20, 90, 0, 2122.9, 2631.3}}};

/// Table 4.3.
struct Compatible {
  double angle_deg, points, share;
};
inline constexpr std::array<Compatible, 5> kCompatible = {{{5, 8.73, 0.0029},
                                                           {15, 71.69, 0.0223},
                                                           {30, 262.46, 0.0809},
                                                           {45, 524.64, 0.1619},
                                                           {60, 833.85, 0.2561}}};

/// Tables 5.7 and 5.8, means over the views and over the groups: max, min, mean of the positive,
/// mean of the negative, sigma, in metres.
inline constexpr std::array<double, 5> kTable57Mean = {0.015551, -0.014569, 0.001931, -0.002175,
                                                       0.002580};
inline constexpr std::array<double, 5> kTable58Mean = {0.017259, -0.016857, 0.001376, -0.001603,
                                                       0.002043};

}  // namespace scanner::evaluation::published
