#include "core/ply_parser.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <sstream>
#include <string>

namespace scanner::ply {
namespace {

enum class Encoding { kAscii, kLittleEndian, kBigEndian };

struct Type {
  std::size_t size = 0;
  bool real = false;
  bool is_signed = false;
};

struct Property {
  std::string name;
  Type type;
  std::optional<Type> count_type;  ///< set for a list
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  Encoding encoding = Encoding::kAscii;
  std::vector<Element> elements;
};

Type parseType(const std::string& name) {
  if (name == "char" || name == "int8") return {1, false, true};
  if (name == "uchar" || name == "uint8") return {1, false, false};
  if (name == "short" || name == "int16") return {2, false, true};
  if (name == "ushort" || name == "uint16") return {2, false, false};
  if (name == "int" || name == "int32") return {4, false, true};
  if (name == "uint" || name == "uint32") return {4, false, false};
  if (name == "float" || name == "float32") return {4, true, true};
  if (name == "double" || name == "float64") return {8, true, true};
  throw ParseError("unknown property type '" + name + "'");
}

Encoding parseEncoding(const std::string& name) {
  if (name == "ascii") return Encoding::kAscii;
  if (name == "binary_little_endian") return Encoding::kLittleEndian;
  if (name == "binary_big_endian") return Encoding::kBigEndian;
  throw ParseError("unknown format '" + name + "'");
}

Property parseProperty(std::istringstream& words) {
  std::string type;
  Property property;
  words >> type;
  if (type == "list") {
    std::string count_type;
    words >> count_type >> type;
    property.count_type = parseType(count_type);
  }
  property.type = parseType(type);
  words >> property.name;
  if (property.name.empty()) throw ParseError("a property has no name");
  return property;
}

Header parseHeader(std::istream& in) {
  Header header;
  std::string line;
  if (!std::getline(in, line) || line.substr(0, 3) != "ply") throw ParseError("not a PLY file");
  while (std::getline(in, line)) {
    std::istringstream words(line);
    std::string keyword;
    words >> keyword;
    if (keyword == "end_header") return header;
    if (keyword == "format") {
      std::string name;
      words >> name;
      header.encoding = parseEncoding(name);
    } else if (keyword == "element") {
      Element element;
      if (!(words >> element.name >> element.count)) throw ParseError("bad line '" + line + "'");
      header.elements.push_back(element);
    } else if (keyword == "property") {
      if (header.elements.empty()) throw ParseError("a property stands before any element");
      header.elements.back().properties.push_back(parseProperty(words));
    }
  }
  throw ParseError("the header has no end");
}

/// Reads single numbers in the file's encoding.
class NumberReader {
 public:
  NumberReader(std::istream& in, Encoding encoding) : in_(in), encoding_(encoding) {}

  double read(const Type& type) {
    if (encoding_ == Encoding::kAscii) return readAscii();
    unsigned char bytes[8];
    in_.read(reinterpret_cast<char*>(bytes), static_cast<std::streamsize>(type.size));
    if (!in_) throw ParseError("the file is truncated");
    if (encoding_ == Encoding::kBigEndian) std::reverse(bytes, bytes + type.size);
    return decode(bytes, type);
  }

 private:
  double readAscii() {
    std::string word;
    if (!(in_ >> word)) throw ParseError("the file is truncated");
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (end != word.c_str() + word.size()) throw ParseError("'" + word + "' is not a number");
    return value;
  }

  template <typename T>
  static double as(const unsigned char* bytes) {
    T value;
    std::memcpy(&value, bytes, sizeof value);
    return static_cast<double>(value);
  }

  static double decode(const unsigned char* bytes, const Type& type) {
    if (type.real) return type.size == 4 ? as<float>(bytes) : as<double>(bytes);
    switch (type.size) {
      case 1:
        return type.is_signed ? as<std::int8_t>(bytes) : as<std::uint8_t>(bytes);
      case 2:
        return type.is_signed ? as<std::int16_t>(bytes) : as<std::uint16_t>(bytes);
      default:
        return type.is_signed ? as<std::int32_t>(bytes) : as<std::uint32_t>(bytes);
    }
  }

  std::istream& in_;
  Encoding encoding_;
};

std::vector<double> readList(NumberReader& reader, const Property& property) {
  const double count = reader.read(*property.count_type);
  if (!(count >= 0.0)) throw ParseError("a list has a negative length");
  std::vector<double> items;
  for (double i = 0.0; i < count; i += 1.0) items.push_back(reader.read(property.type));
  return items;
}

struct VertexLayout {
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::size_t x = kNone, y = kNone, z = kNone, nx = kNone, ny = kNone, nz = kNone;
  std::size_t red = kNone, green = kNone, blue = kNone, sigma = kNone;
  bool colors_are_real = false;

  explicit VertexLayout(const Element& element) {
    const auto find = [&](const char* name) {
      for (std::size_t i = 0; i < element.properties.size(); ++i) {
        if (element.properties[i].name == name && !element.properties[i].count_type) return i;
      }
      return kNone;
    };
    x = find("x"), y = find("y"), z = find("z");
    nx = find("nx"), ny = find("ny"), nz = find("nz");
    red = find("red"), green = find("green"), blue = find("blue");
    sigma = find("sigma");
    if (x == kNone || y == kNone || z == kNone) throw ParseError("the vertices have no x, y, z");
    if (hasColors()) colors_are_real = element.properties[red].type.real;
  }
  bool hasNormals() const { return nx != kNone && ny != kNone && nz != kNone; }
  bool hasColors() const { return red != kNone && green != kNone && blue != kNone; }
};

std::uint8_t toByte(double value, bool real) {
  return static_cast<std::uint8_t>(std::clamp(real ? 255.0 * value + 0.5 : value, 0.0, 255.0));
}

void readVertices(NumberReader& reader, const Element& element, PointCloud* cloud) {
  const VertexLayout at(element);
  std::vector<double> row(element.properties.size());
  for (std::size_t v = 0; v < element.count; ++v) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (element.properties[i].count_type) {
        readList(reader, element.properties[i]);
      } else {
        row[i] = reader.read(element.properties[i].type);
      }
    }
    const auto vector = [&](std::size_t a, std::size_t b, std::size_t c) {
      return Eigen::Vector3d(row[a], row[b], row[c]).cast<float>().eval();
    };
    cloud->points.push_back(vector(at.x, at.y, at.z));
    if (at.hasNormals()) cloud->normals.push_back(vector(at.nx, at.ny, at.nz));
    if (at.hasColors()) {
      cloud->colors.push_back({toByte(row[at.red], at.colors_are_real),
                               toByte(row[at.green], at.colors_are_real),
                               toByte(row[at.blue], at.colors_are_real)});
    }
    if (at.sigma != VertexLayout::kNone) cloud->sigmas.push_back(static_cast<float>(row[at.sigma]));
  }
}

void readFaces(NumberReader& reader, const Element& element, std::size_t vertex_count, Mesh* mesh) {
  for (std::size_t f = 0; f < element.count; ++f) {
    for (const Property& property : element.properties) {
      if (!property.count_type) {
        reader.read(property.type);
        continue;
      }
      const std::vector<double> corners = readList(reader, property);
      if (property.name != "vertex_indices" && property.name != "vertex_index") continue;
      for (const double corner : corners) {
        if (!(corner >= 0.0) || corner >= static_cast<double>(vertex_count)) {
          throw ParseError("face " + std::to_string(f) + " names a vertex that does not exist");
        }
      }
      const auto index = [&](std::size_t i) { return static_cast<std::uint32_t>(corners[i]); };
      for (std::size_t i = 2; i < corners.size(); ++i) {
        mesh->faces.push_back({index(0), index(i - 1), index(i)});
      }
    }
  }
}

void skip(NumberReader& reader, const Element& element) {
  for (std::size_t i = 0; i < element.count; ++i) {
    for (const Property& property : element.properties) {
      if (property.count_type) {
        readList(reader, property);
      } else {
        reader.read(property.type);
      }
    }
  }
}

}  // namespace

Mesh parse(std::istream& in) {
  const Header header = parseHeader(in);
  const auto vertices = std::find_if(header.elements.begin(), header.elements.end(),
                                     [](const Element& e) { return e.name == "vertex"; });
  if (vertices == header.elements.end()) throw ParseError("the file has no vertices");
  // What nobody reads at the end of the file (a Stanford range grid, say) need not be parsed.
  const auto last =
      std::find_if(header.elements.rbegin(), header.elements.rend(),
                   [](const Element& e) { return e.name == "vertex" || e.name == "face"; });
  NumberReader reader(in, header.encoding);
  Mesh mesh;
  for (const Element& element : header.elements) {
    if (element.name == "vertex") {
      readVertices(reader, element, &mesh.vertices);
    } else if (element.name == "face") {
      readFaces(reader, element, vertices->count, &mesh);
    } else {
      skip(reader, element);
    }
    if (&element == &*last) break;
  }
  return mesh;
}

}  // namespace scanner::ply
