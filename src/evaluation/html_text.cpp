#include "evaluation/html_text.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iomanip>
#include <locale>
#include <sstream>

namespace scanner::evaluation::html {
namespace {

constexpr const char* kDash = "\xE2\x80\x93";
constexpr const char* kThinSpace = "\xE2\x80\xAF";  // narrow, does not break

/// Length of the UTF-8 sequence that starts at `at`; 0 when there is none.
std::size_t sequenceLength(const std::string& text, std::size_t at) {
  const auto byte = [&text](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(at);
  if (lead < 0x80) return 1;
  const std::size_t length = lead >= 0xC2 && lead < 0xE0   ? 2
                             : lead >= 0xE0 && lead < 0xF0 ? 3
                             : lead >= 0xF0 && lead < 0xF5 ? 4
                                                           : 0;
  if (length == 0 || at + length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0U) != 0x80U) return 0;
  }
  return length;
}

void addRow(std::string& out, const std::vector<std::string>& cells, const char* element) {
  out += "<tr>";
  for (const std::string& cell : cells) {
    out += std::string("<") + element + ">" + cell + "</" + element + ">";
  }
  out += "</tr>\n";
}

std::string classOf(const Table& table) {
  if (table.words) return " class=\"words\"";
  return table.words_in_second ? " class=\"second\"" : "";
}

std::string rowsOf(const Table& table, bool rows, bool summary) {
  std::string out = "<div class=\"scroll\"><table" + classOf(table) + ">\n";
  if (!table.head.empty()) {
    out += "<thead>";
    addRow(out, table.head, "th");
    out += "</thead>\n";
  }
  if (rows) {
    out += "<tbody>\n";
    for (const auto& row : table.rows) addRow(out, row, "td");
    out += "</tbody>\n";
  }
  if (summary && !table.summary.empty()) {
    out += "<tbody class=\"summary\">\n";
    for (const auto& row : table.summary) addRow(out, row, "td");
    out += "</tbody>\n";
  }
  return out + "</table></div>\n";
}

}  // namespace

std::string escape(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = sequenceLength(text, i);
    const char c = text[i];
    if (length == 0 ||
        (length == 1 && static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t')) {
      out += "\xEF\xBF\xBD";
      ++i;
      continue;
    }
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out.append(text, i, length);
    }
    i += length;
  }
  return out;
}

std::string fixed(double value, int digits) {
  if (!std::isfinite(value)) return kDash;
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out << std::fixed << std::setprecision(digits) << value;
  std::string text = out.str();
  // "-0.00" says nothing that "0.00" does not.
  if (text[0] == '-' && text.find_first_not_of("-0.") == std::string::npos) text.erase(0, 1);
  return text;
}

std::string brief(double value) {
  const double size = std::abs(value);
  return fixed(value, size < 9.995 ? 2 : size < 99.95 ? 1 : 0);
}

std::string millimetres(double metres) {
  return std::isfinite(metres) ? brief(1e3 * metres) + "&nbsp;mm" : kDash;
}

std::string degrees(double deg) { return std::isfinite(deg) ? brief(deg) + "\xC2\xB0" : kDash; }

std::string seconds(double s) {
  if (!std::isfinite(s)) return kDash;
  if (s < 90.0) return fixed(s, s < 10.0 ? 1 : 0) + "&nbsp;s";
  const auto whole = static_cast<long long>(std::llround(s));
  return std::to_string(whole / 60) + "&nbsp;min " + std::to_string(whole % 60) + "&nbsp;s";
}

std::string grouped(std::size_t count) {
  const std::string digits = std::to_string(count);
  std::string out;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) out += kThinSpace;
    out += digits[i];
  }
  return out;
}

std::string counted(std::size_t count, const std::string& singular, const std::string& plural) {
  return grouped(count) + " " + (count == 1 ? singular : plural);
}

std::string dataUri(const std::string& mime, const std::string& bytes) {
  static const char* kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out = "data:" + mime + ";base64,";
  out.reserve(out.size() + bytes.size() * 4 / 3 + 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t n = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      word = (word << 8U) | (k < n ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      out += k <= n ? kAlphabet[(word >> (18U - 6U * k)) & 63U] : '=';
    }
  }
  return out;
}

std::string toHtml(const Table& table) {
  std::string out = "<div class=\"table\">\n<h3>" + table.caption + "</h3>\n";
  if (!table.note.empty()) out += "<p class=\"note\">" + table.note + "</p>\n";
  if (table.fold && !table.rows.empty()) {
    if (!table.summary.empty()) out += rowsOf(table, false, true);
    out += "<details><summary>" + counted(table.rows.size(), "row", "rows") + "</summary>\n" +
           rowsOf(table, true, false) + "</details>\n";
  } else {
    out += rowsOf(table, true, true);
  }
  return out + "</div>\n";
}

std::string section(const std::string& id, const std::string& title, const std::string& body) {
  return "<section id=\"" + id + "\">\n<h2>" + title + "</h2>\n" + body + "</section>\n";
}

std::string paragraph(const std::string& html) { return "<p>" + html + "</p>\n"; }

}  // namespace scanner::evaluation::html
