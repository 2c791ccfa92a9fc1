#pragma once

#include <string>
#include <vector>

/// Building blocks of report.html. All text that comes from outside passes through escape().
namespace scanner::evaluation::html {

/// Safe inside an element and inside a quoted attribute; bytes that are no UTF-8 become U+FFFD.
std::string escape(const std::string& text);

/// `digits` after the point, whatever the locale; a dash for what is not known.
std::string fixed(double value, int digits);
/// Three significant digits at most, never an exponent: 1234, 123, 12.3, 1.23, 0.12.
std::string brief(double value);
/// Metres as millimetres, with the unit, for running text.
std::string millimetres(double metres);
std::string degrees(double deg);
std::string seconds(double s);
/// 1234567 -> "1 234 567" with thin spaces that do not break.
std::string grouped(std::size_t count);
std::string counted(std::size_t count, const std::string& singular, const std::string& plural);

/// Content of a file or buffer as the value of src=.
std::string dataUri(const std::string& mime, const std::string& bytes);

/// Cells, caption and note hold finished HTML; no `head`, no line of titles. `summary` rows stand
/// under a rule and stay visible when the rows are folded away.
struct Table {
  std::string caption;
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
  std::vector<std::vector<std::string>> summary;
  std::string note;
  bool fold = false;             ///< put the rows into <details>
  bool words_in_second = false;  ///< the second column stands to the left
  bool words = false;            ///< cells hold words, which stand to the left
};

std::string toHtml(const Table& table);

std::string section(const std::string& id, const std::string& title, const std::string& body);
std::string paragraph(const std::string& html);

}  // namespace scanner::evaluation::html
