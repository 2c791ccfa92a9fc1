#include "scanner/core/ply.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "support/temporary_folder.h"

namespace scanner {
namespace {

Mesh triangle() {
  Mesh mesh;
  mesh.vertices.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.1F}};
  mesh.vertices.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
  mesh.vertices.colors = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}};
  mesh.vertices.sigmas = {0.1F, 0.2F, 0.3F};
  mesh.faces = {{0, 1, 2}};
  return mesh;
}

void write(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

std::string contents(const std::string& path) {
  std::ostringstream out;
  out << std::ifstream(path, std::ios::binary).rdbuf();
  return out.str();
}

TEST(Ply, RoundTripKeepsEveryAttribute) {
  const test::TemporaryFolder folder;
  const Mesh mesh = triangle();
  ASSERT_TRUE(writePly(folder / "m.ply", mesh));
  const Result<Mesh> read = readPly(folder / "m.ply");
  ASSERT_TRUE(read) << read.status().message();
  EXPECT_EQ(read->faces, mesh.faces);
  EXPECT_EQ(read->vertices.points[2], mesh.vertices.points[2]);
  EXPECT_EQ(read->vertices.normals[1], mesh.vertices.normals[1]);
  EXPECT_EQ(read->vertices.colors[2], mesh.vertices.colors[2]);
  EXPECT_EQ(read->vertices.sigmas, mesh.vertices.sigmas);
}

TEST(Ply, SameInputSameBytes) {
  const test::TemporaryFolder folder;
  ASSERT_TRUE(writePly(folder / "a.ply", triangle()));
  ASSERT_TRUE(writePly(folder / "b.ply", triangle()));
  EXPECT_EQ(contents(folder / "a.ply"), contents(folder / "b.ply"));
}

TEST(Ply, ReadsAsciiWithRangeGridAndSkipsUnknownProperties) {
  const test::TemporaryFolder folder;
  write(
      folder / "s.ply",
      "ply\nformat ascii 1.0\nobj_info num_cols 2\nelement vertex 2\nproperty float x\n"
      "property float y\nproperty float z\nproperty float confidence\nelement range_grid 4\n"
      "property list uchar int vertex_indices\nend_header\n1 2 3 0.5\n4 5 6 0.7\n0\n1 0\n1 1\n0\n");
  const Result<Mesh> read = readPly(folder / "s.ply");
  ASSERT_TRUE(read) << read.status().message();
  ASSERT_EQ(read->vertices.size(), 2U);
  EXPECT_EQ(read->vertices.points[1], Eigen::Vector3f(4, 5, 6));
  EXPECT_TRUE(read->faces.empty());
}

TEST(Ply, ReadsBigEndianAndFansPolygons) {
  const test::TemporaryFolder folder;
  std::string text =
      "ply\nformat binary_big_endian 1.0\nelement vertex 4\nproperty short x\nproperty short y\n"
      "property short z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n";
  const char corners[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  for (const auto& c : corners) {
    text += std::string{0, c[0], 0, c[1], 0, 0};
  }
  text += std::string{4, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3};
  write(folder / "q.ply", text);
  const Result<Mesh> read = readPly(folder / "q.ply");
  ASSERT_TRUE(read) << read.status().message();
  EXPECT_EQ(read->vertices.points[2], Eigen::Vector3f(1, 1, 0));
  ASSERT_EQ(read->faces.size(), 2U);
  EXPECT_EQ(read->faces[1], (std::array<std::uint32_t, 3>{0, 2, 3}));
}

TEST(Ply, BrokenFilesGiveOneLineThatNamesThem) {
  const test::TemporaryFolder folder;
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
      "property float y\nproperty float z\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"not", "hello"},
      {"no_end", head},
      {"truncated", head + "end_header\n1 2"},
      {"word", head + "end_header\n1 2 x\n"},
      {"no_z", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n"},
      {"type", "ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n"},
      {"huge",
       "ply\nformat ascii 1.0\nelement vertex 999999999999\nproperty float x\nproperty "
       "float y\nproperty float z\nend_header\n1 2 3\n"},
      {"face", head + "element face 1\nproperty list uchar int vertex_indices\nend_header\n1 2 3\n"
                      "3 0 0 1\n"},
  };
  for (const auto& [name, text] : cases) {
    write(folder / name, text);
    const Result<Mesh> read = readPly(folder / name);
    ASSERT_FALSE(read) << name;
    EXPECT_NE(read.status().message().find(name), std::string::npos);
    EXPECT_EQ(read.status().message().find('\n'), std::string::npos);
  }
  EXPECT_EQ(readPly(folder / "absent").status().code(), StatusCode::kIoError);
}

TEST(WriteFileAtomically, LeavesTheOldFileWhenTheNewOneFails) {
  const test::TemporaryFolder folder;
  ASSERT_TRUE(writeFileAtomically(folder / "f", "old"));
  EXPECT_FALSE(writeFileAtomically(folder / "no/such/folder", "x"));
  // A folder in the way of the temporary file makes the write fail.
  std::filesystem::create_directory(folder / "f.part");
  EXPECT_EQ(writeFileAtomically(folder / "f", "new").code(), StatusCode::kIoError);
  EXPECT_EQ(contents(folder / "f"), "old");
}

TEST(WriteFileAtomically, AFullDiskIsAnErrorNotAShortFile) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "SKIPPED: no /dev/full here";
  const test::TemporaryFolder folder;
  std::filesystem::create_symlink("/dev/full", folder / "f.part");
  ASSERT_TRUE(std::filesystem::exists(folder / "f.part"));
  const Status status = writeFileAtomically(folder / "f", std::string(1 << 20, 'x'));
  EXPECT_EQ(status.code(), StatusCode::kIoError);
  EXPECT_FALSE(std::filesystem::exists(folder / "f"));
}

}  // namespace
}  // namespace scanner
