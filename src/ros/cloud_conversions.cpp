#include <cmath>
#include <cstring>
#include <limits>

#include "scanner/core/parallel.h"
#include "scanner/ros/conversions.h"

// PointCloud2 by plain memory writes: sensor_msgs' iterators cost 1.6 s of compile time per file
// and a division per element.
namespace scanner::bridge {
namespace {

constexpr std::size_t kPointsPerChunk = 16384;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

void addField(sensor_msgs::PointCloud2& message, const char* name) {
  sensor_msgs::PointField field;
  field.name = name;
  field.offset = message.point_step;
  field.datatype = sensor_msgs::PointField::FLOAT32;
  field.count = 1;
  message.fields.push_back(field);
  message.point_step += static_cast<std::uint32_t>(sizeof(float));
}

float packed(const Rgb8& c) {
  const std::uint32_t bits = (static_cast<std::uint32_t>(c.r) << 16) |
                             (static_cast<std::uint32_t>(c.g) << 8) |
                             static_cast<std::uint32_t>(c.b);
  float value = 0.0F;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

Rgb8 unpacked(const std::uint8_t* data) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, data, sizeof(bits));
  return {static_cast<std::uint8_t>(bits >> 16), static_cast<std::uint8_t>(bits >> 8),
          static_cast<std::uint8_t>(bits)};
}

std::uint8_t* put(std::uint8_t* out, float value) {
  std::memcpy(out, &value, sizeof(value));
  return out + sizeof(value);
}

std::uint8_t* put(std::uint8_t* out, const Eigen::Vector3f& value) {
  std::memcpy(out, value.data(), 3 * sizeof(float));
  return out + 3 * sizeof(float);
}

const sensor_msgs::PointField* find(const sensor_msgs::PointCloud2& message, const char* name) {
  for (const sensor_msgs::PointField& field : message.fields) {
    const bool four_bytes = field.datatype == sensor_msgs::PointField::FLOAT32 ||
                            field.datatype == sensor_msgs::PointField::UINT32;
    if (field.name == name && four_bytes && field.offset + 4 <= message.point_step) return &field;
  }
  return nullptr;
}

/// Offset of three consecutive scalar fields, or nothing when one is missing.
bool findVector(const sensor_msgs::PointCloud2& message, const char* x, const char* y,
                const char* z, std::array<std::uint32_t, 3>& offsets) {
  const std::array<const char*, 3> names = {x, y, z};
  for (std::size_t i = 0; i < 3; ++i) {
    const sensor_msgs::PointField* field = find(message, names[i]);
    if (!field || field->datatype != sensor_msgs::PointField::FLOAT32) return false;
    offsets[i] = field->offset;
  }
  return true;
}

Eigen::Vector3f readVector(const std::uint8_t* point, const std::array<std::uint32_t, 3>& at) {
  Eigen::Vector3f v;
  for (std::size_t i = 0; i < 3; ++i) {
    std::memcpy(v.data() + i, point + at[i], sizeof(float));
  }
  return v;
}

/// A message of one row whose points are still to be written.
sensor_msgs::PointCloud2 layoutFor(const PointCloud& cloud, const std_msgs::Header& header) {
  sensor_msgs::PointCloud2 message;
  message.header = header;
  message.height = 1;
  message.width = static_cast<std::uint32_t>(cloud.size());
  message.is_bigendian = false;
  message.point_step = 0;
  for (const char* name : {"x", "y", "z"}) addField(message, name);
  if (cloud.hasNormals()) {
    for (const char* name : {"normal_x", "normal_y", "normal_z"}) addField(message, name);
  }
  if (cloud.hasColors()) addField(message, "rgb");
  if (cloud.hasSigmas()) addField(message, "sigma");
  message.row_step = message.point_step * message.width;
  message.data.resize(message.row_step);
  return message;
}

/// Points [begin, end); whether all of them are finite.
bool write(const PointCloud& cloud, std::size_t begin, std::size_t end,
           sensor_msgs::PointCloud2& message) {
  std::uint8_t* out = message.data.data() + begin * message.point_step;
  const bool normals = cloud.hasNormals(), colors = cloud.hasColors(), sigmas = cloud.hasSigmas();
  bool dense = true;
  for (std::size_t i = begin; i < end; ++i) {
    out = put(out, cloud.points[i]);
    if (normals) out = put(out, cloud.normals[i]);
    if (colors) out = put(out, packed(cloud.colors[i]));
    if (sigmas) out = put(out, cloud.sigmas[i]);
    dense = dense && cloud.points[i].allFinite();
  }
  return dense;
}

}  // namespace

sensor_msgs::PointCloud2 toRos(const PointCloud& cloud, const std_msgs::Header& header) {
  sensor_msgs::PointCloud2 message = layoutFor(cloud, header);
  message.is_dense = write(cloud, 0, cloud.size(), message);
  return message;
}

sensor_msgs::PointCloud2 toRos(const OrganizedCloud& cloud, const std::string& frame_id,
                               int threads) {
  sensor_msgs::PointCloud2 message = layoutFor(cloud.cloud, makeHeader(cloud.stamp, frame_id));
  message.width = static_cast<std::uint32_t>(cloud.width);
  message.height = static_cast<std::uint32_t>(cloud.height);
  message.row_step = message.point_step * message.width;
  message.is_dense = false;
  parallelFor(cloud.cloud.size(), kPointsPerChunk, threads,
              [&](std::size_t begin, std::size_t end) { write(cloud.cloud, begin, end, message); });
  return message;
}

Result<PointCloud> pointsFromRos(const sensor_msgs::PointCloud2& message) {
  if (message.is_bigendian) {
    return Status(StatusCode::kUnsupported, "point cloud: big endian data is not handled");
  }
  std::array<std::uint32_t, 3> xyz{};
  std::array<std::uint32_t, 3> normal{};
  if (!findVector(message, "x", "y", "z", xyz)) {
    return Status(StatusCode::kInvalidInput, "point cloud: no float32 fields x, y, z");
  }
  const std::size_t step = message.point_step;
  if (message.row_step < step * message.width ||
      message.data.size() < static_cast<std::size_t>(message.row_step) * message.height) {
    return Status(StatusCode::kInvalidInput, "point cloud: " + std::to_string(message.data.size()) +
                                                 " bytes are too few for " +
                                                 std::to_string(message.width) + "x" +
                                                 std::to_string(message.height) + " points of " +
                                                 std::to_string(step) + " bytes");
  }
  const bool normals = findVector(message, "normal_x", "normal_y", "normal_z", normal);
  const sensor_msgs::PointField* rgb = find(message, "rgb");
  const sensor_msgs::PointField* sigma = find(message, "sigma");
  const std::size_t n = static_cast<std::size_t>(message.width) * message.height;
  PointCloud cloud;
  cloud.points.reserve(n);
  if (normals) cloud.normals.reserve(n);
  if (rgb) cloud.colors.reserve(n);
  if (sigma) cloud.sigmas.reserve(n);
  for (std::size_t row = 0; row < message.height; ++row) {
    const std::uint8_t* point = message.data.data() + row * message.row_step;
    for (std::size_t col = 0; col < message.width; ++col, point += step) {
      cloud.points.push_back(readVector(point, xyz));
      if (normals) cloud.normals.push_back(readVector(point, normal));
      if (rgb) cloud.colors.push_back(unpacked(point + rgb->offset));
      if (sigma) {
        float value = kNaN;
        std::memcpy(&value, point + sigma->offset, sizeof(value));
        cloud.sigmas.push_back(value);
      }
    }
  }
  return cloud;
}

Result<OrganizedCloud> fromRos(const sensor_msgs::PointCloud2& message) {
  Result<PointCloud> points = pointsFromRos(message);
  if (!points) return points.status();
  OrganizedCloud cloud;
  cloud.stamp = fromRos(message.header.stamp);
  cloud.width = static_cast<int>(message.width);
  cloud.height = static_cast<int>(message.height);
  cloud.cloud = std::move(*points);
  return cloud;
}

}  // namespace scanner::bridge
