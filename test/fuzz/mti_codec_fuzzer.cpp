/// Arbitrary bytes as a serial line would bring them, through everything that reads them. A broken
/// promise aborts, which libFuzzer reports as it does a crash.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <vector>

#include "scanner/mti/mt_data.h"
#include "scanner/mti/mt_data2.h"
#include "scanner/mti/plausibility.h"
#include "scanner/mti/settings.h"

namespace {

using namespace scanner::mti;  // NOLINT(google-build-using-namespace)
using scanner::Result;
using Bytes = std::vector<std::uint8_t>;

void require(bool condition, const char* promise) {
  if (condition) return;
  std::fprintf(stderr, "broken promise: %s\n", promise);
  std::abort();
}

/// Decisions of the run come from the front of the input, the line's bytes are the rest.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  unsigned byte() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }
  Bytes rest() const { return {data_, data_ + size_}; }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

/// Makes the checksum of everything that looks like a frame right: mutations get past it.
void repairChecksums(Bytes& bytes) {
  for (std::size_t i = 0; i + 4 < bytes.size(); ++i) {
    const std::size_t end = i + 4U + bytes[i + 3];
    if (bytes[i] != 0xFA || bytes[i + 1] != 0xFF || bytes[i + 3] == 0xFF || end >= bytes.size()) {
      continue;
    }
    unsigned sum = 0;
    for (std::size_t j = i + 1; j < end; ++j) sum += bytes[j];
    bytes[end] = static_cast<std::uint8_t>((0x100U - (sum & 0xFFU)) & 0xFFU);
    i = end;
  }
}

/// Pushed in chunks, the parser must find the same messages as in one piece.
std::vector<Message> parse(const Bytes& bytes, std::size_t chunk, std::size_t longest,
                           MessageParser::Statistics* statistics = nullptr) {
  MessageParser parser(longest);
  std::vector<Message> messages;
  std::size_t framed = 0;
  for (std::size_t i = 0; i < bytes.size(); i += chunk) {
    parser.push(bytes.data() + i, std::min(chunk, bytes.size() - i));
    while (auto message = parser.next()) {
      require(message->data.size() <= longest, "no message is longer than allowed");
      framed += encode(*message).size();
      messages.push_back(std::move(*message));
    }
  }
  require(framed + parser.statistics().skipped_bytes <= bytes.size(), "no byte is used twice");
  require(parser.statistics().messages == messages.size(), "messages are counted");
  if (statistics != nullptr) *statistics = parser.statistics();
  return messages;
}

bool same(const Message& a, const Message& b) { return a.id == b.id && a.data == b.data; }

template <typename Field>
void requireFinite(const Field& field) {
  require(!field || field->allFinite(), "values are finite");
}

void checkMtData(const Message& message, std::uint16_t mode, std::uint32_t settings) {
  const Result<MtData> data = decodeMtData(message, mode, settings);
  const double defect = rotationDefect(message, mode, settings);
  require(defect >= 0.0 && defect < 1.0, "the defect of a rotation is small");
  if (!data) return;
  requireFinite(data->acceleration);
  requireFinite(data->angular_velocity);
  requireFinite(data->magnetic_field);
  require(!data->temperature_c || std::isfinite(*data->temperature_c), "temperature is finite");
  if (data->orientation) {
    require(std::abs(data->orientation->norm() - 1.0) < 1e-9, "orientation has length one");
  }
  const Message again = encodeMtData(*data, mode, settings);
  require(again.data.size() == mtDataSize(mode, settings), "the size is that of the mode");
  const Result<MtData> back = decodeMtData(again, mode, settings);
  require(back.isOk(), "what was encoded decodes");
  require(back->acceleration == data->acceleration, "acceleration survives");
  require(back->angular_velocity == data->angular_velocity, "rate survives");
  require(back->magnetic_field == data->magnetic_field, "field survives");
  require(back->temperature_c == data->temperature_c, "temperature survives");
  require(back->analog_in_1 == data->analog_in_1, "analog input 1 survives");
  require(back->analog_in_2 == data->analog_in_2, "analog input 2 survives");
  require(back->status == data->status, "status survives");
  require(back->counter == data->counter, "counter survives");
  require(back->orientation.has_value() == data->orientation.has_value(), "orientation survives");
  // Gimbal lock costs Euler angles in single precision half of their digits.
  if (data->orientation) {
    const double cosine = std::abs(back->orientation->dot(*data->orientation));
    require(cosine > 1.0 - 1e-6, "orientation is the same");
  }
}

/// Identifiers of a message that is known to decode, unknown ones left out.
std::vector<std::uint16_t> identifiersOf(const Message& message) {
  std::vector<std::uint16_t> identifiers;
  for (std::size_t i = 0; i + 3 <= message.data.size(); i += 3U + message.data[i + 2]) {
    const auto identifier =
        static_cast<std::uint16_t>((message.data[i] << 8U) | message.data[i + 1]);
    const Message alone{
        message.id,
        Bytes(message.data.begin() + static_cast<std::ptrdiff_t>(i),
              message.data.begin() + static_cast<std::ptrdiff_t>(i + 3U + message.data[i + 2]))};
    const Result<MtData2> packet = decodeMtData2(alone);
    require(packet.isOk(), "packets of a good message decode alone");
    if (packet->skipped == 0) identifiers.push_back(identifier);
  }
  return identifiers;
}

void checkMtData2(const Message& message) {
  const Result<MtData2> data = decodeMtData2(message);
  if (!data) return;
  for (const auto* field :
       {&data->acceleration, &data->acceleration_hr, &data->delta_v, &data->angular_velocity,
        &data->angular_velocity_hr, &data->magnetic_field, &data->position_ecef_m}) {
    requireFinite(*field);
  }
  const auto orientation = data->orientation();
  if (orientation) {
    require(std::abs(orientation->value.norm() - 1.0) < 1e-9, "orientation has length one");
  }
  require(data->rotationDefect() < 1.0, "the defect of a rotation is small");
  const MtData common = toMtData(*data);
  require(common.orientation.has_value() == orientation.has_value(), "orientation is passed on");
  const std::vector<std::uint16_t> identifiers = identifiersOf(message);
  const Message again = encodeMtData2(*data, identifiers);
  const Result<MtData2> back = decodeMtData2(again);
  require(back.isOk() && back->skipped == 0, "what was encoded decodes");
  require(same(encodeMtData2(*back, identifiers), again), "and encodes to the same bytes");
}

void checkAnswers(const Message& message) {
  if (const auto configuration = parseConfiguration(message)) {
    require(!configuration->devices.empty(), "a configuration has a device");
    require(std::isfinite(configuration->rateHz()), "its rate is finite");
    const auto back = parseConfiguration(encodeConfiguration(*configuration));
    require(back && back->devices.size() == configuration->devices.size(),
            "a configuration survives");
  }
  if (const auto selections = parseOutputConfiguration(message)) {
    if (selections->size() <= 32) {
      const Message again = setOutputConfiguration(*selections);
      require(again.data == message.data, "an output configuration survives");
    }
  }
  if (const auto id = parseDeviceId(message)) require(deviceIdText(*id).size() >= 8, "an id reads");
  if (const auto rate = parseBaudRate(message)) {
    require(baudRateIdentifier(*rate).has_value(), "a rate has an identifier");
  }
  if (const auto gain = parseFilterParameter(message, FilterParameter::kGain)) {
    require(std::isfinite(*gain), "a filter gain is finite");
  }
  if (const auto firmware = parseFirmwareRevision(message)) {
    require(!toString(*firmware).empty(), "firmware reads");
  }
  if (const auto code = parseError(message)) require(!describe(*code).empty(), "errors read");
  (void)parseProductCode(message);
  (void)parseFilterScenarios(message);
  for (const std::size_t bytes : {1U, 2U, 4U}) {
    (void)parseNumber(message, MessageId::kSetPeriod, bytes);
  }
}

void checkFilter(const Bytes& bytes, std::size_t chunk, std::uint16_t mode,
                 std::uint32_t settings) {
  MessageParser parser;
  PlausibilityFilter filter;
  std::uint64_t pushed = 0;
  std::uint64_t taken = 0;
  const auto take = [&] {
    while (const auto reading = filter.next()) ++taken;
  };
  for (std::size_t i = 0; i < bytes.size(); i += chunk) {
    parser.push(bytes.data() + i, std::min(chunk, bytes.size() - i));
    while (const auto message = parser.next()) {
      std::optional<Reading> reading;
      if (auto data = decodeMtData(*message, mode, settings)) {
        reading = Reading{*data, {}, rotationDefect(*message, mode, settings)};
      } else if (auto data2 = decodeMtData2(*message)) {
        reading = Reading{toMtData(*data2), {}, data2->rotationDefect()};
      }
      pushed += reading ? 1 : 0;
      filter.push(*message, std::move(reading), parser.statistics());
      take();
    }
  }
  filter.flush();
  take();
  require(taken == filter.statistics().accepted, "what is accepted is given on");
  require(pushed == taken + filter.statistics().rejected(), "nothing is forgotten");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::uint16_t kModes[] = {0x0006, 0x0007, 0x080F, 0x0002, 0x0004, 0x0001, 0x0800};
  constexpr std::size_t kLongest[] = {254, 16, 1000, kLongestData};
  Input input(data, size);
  const std::uint16_t mode = kModes[input.byte() % std::size(kModes)];
  const std::uint32_t settings = (input.byte() | (input.byte() & 0xFU) << 8U) & 0xC7DU;
  const std::size_t chunk = 1 + input.byte() % 97;
  const std::size_t longest = kLongest[input.byte() % std::size(kLongest)];
  const bool repair = input.byte() % 2 == 1;
  Bytes bytes = input.rest();
  if (repair) repairChecksums(bytes);

  const std::vector<Message> messages = parse(bytes, chunk, longest);
  const std::vector<Message> at_once = parse(bytes, bytes.size() + 1, longest);
  require(messages.size() == at_once.size() &&
              std::equal(messages.begin(), messages.end(), at_once.begin(), same),
          "chunks do not matter");
  for (const Message& message : messages) {
    const Bytes frame = encode(message);
    const std::vector<Message> back = parse(frame, frame.size(), kLongestData);
    require(back.size() == 1 && same(back[0], message), "a message survives");
    checkMtData(message, mode, settings);
    checkMtData2(message);
    checkAnswers(message);
  }
  checkFilter(bytes, chunk, mode, settings);
  return 0;
}
