#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace scanner {

/// What kind of trouble the data brought. Broken contracts and bad configuration throw instead.
enum class StatusCode {
  kOk,
  kInvalidInput,   ///< NaN, wrong size, wrong order, unequal stamps
  kNotEnoughData,  ///< empty cloud, too few points, too few samples
  kNoConvergence,  ///< an iterative method did not reach its threshold
  kNoOverlap,      ///< two clouds share no surface
  kOutOfRange,     ///< a time or place outside what is known
  kIoError,        ///< a file cannot be read or written
  kUnsupported,    ///< an encoding or format that is not handled
};

/// Short stable name, as used in reports ("no_convergence").
const char* toString(StatusCode code);

/// Outcome of a step that data can make fail: a code and one clear line naming the thing.
class Status {
 public:
  Status() = default;
  Status(StatusCode code, std::string message) : code_(code), message_(std::move(message)) {}
  static Status ok() { return {}; }

  bool isOk() const { return code_ == StatusCode::kOk; }
  explicit operator bool() const { return isOk(); }
  StatusCode code() const { return code_; }
  const std::string& message() const { return message_; }

 private:
  StatusCode code_ = StatusCode::kOk;
  std::string message_;
};

/// A value, or the status that says why there is none. Reading the value of a failed result is a
/// broken contract and throws std::logic_error with the status' message.
template <typename T>
class Result {
 public:
  // Implicit on purpose, so that `return value;` and `return Status(...)` both read naturally.
  Result(T value) : value_(std::move(value)) {}         // NOLINT(google-explicit-constructor)
  Result(Status status) : status_(std::move(status)) {  // NOLINT(google-explicit-constructor)
    if (status_.isOk()) throw std::logic_error("Result: an ok status needs a value");
  }

  bool isOk() const { return value_.has_value(); }
  explicit operator bool() const { return isOk(); }
  const Status& status() const { return status_; }

  const T& value() const& { return requireValue(), *value_; }
  T& value() & { return requireValue(), *value_; }
  T&& value() && { return requireValue(), std::move(*value_); }
  const T& operator*() const& { return value(); }
  T& operator*() & { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  const T* operator->() const { return &value(); }
  T* operator->() { return &value(); }

 private:
  void requireValue() const {
    if (!value_) throw std::logic_error("Result without a value: " + status_.message());
  }

  std::optional<T> value_;
  Status status_;
};

/// Bad configuration or an unusable argument: what, which value, which limit. Programs print the
/// message as one line and exit with 1.
class ConfigurationError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace scanner
