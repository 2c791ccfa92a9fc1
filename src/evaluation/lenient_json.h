#pragma once

#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>
#include <vector>

/// Reading of files that another version may have written: what is absent, null or of another type
/// is unknown, not an error.
namespace scanner::evaluation {

using Json = nlohmann::ordered_json;

inline const Json& member(const Json& json, const char* key) {
  static const Json kNothing;
  if (!json.is_object()) return kNothing;
  const auto found = json.find(key);
  return found == json.end() ? kNothing : *found;
}

inline double numberOf(const Json& json, const char* key,
                       double unknown = std::numeric_limits<double>::quiet_NaN()) {
  const Json& value = member(json, key);
  return value.is_number() ? value.get<double>() : unknown;
}

/// Integers of any size that a double would round, stamps above all.
template <typename Integer>
Integer integerOf(const Json& json, const char* key, Integer unknown = 0) {
  const Json& value = member(json, key);
  const bool fits =
      std::is_unsigned_v<Integer> ? value.is_number_unsigned() : value.is_number_integer();
  return fits ? value.get<Integer>() : unknown;
}

inline bool flagOf(const Json& json, const char* key) {
  const Json& value = member(json, key);
  return value.is_boolean() && value.get<bool>();
}

inline std::string textOf(const Json& json, const char* key) {
  const Json& value = member(json, key);
  return value.is_string() ? value.get<std::string>() : std::string();
}

/// The elements of an array that are objects.
inline std::vector<const Json*> objectsOf(const Json& json, const char* key) {
  std::vector<const Json*> objects;
  const Json& list = member(json, key);
  if (!list.is_array()) return objects;
  for (const Json& item : list) {
    if (item.is_object()) objects.push_back(&item);
  }
  return objects;
}

}  // namespace scanner::evaluation
