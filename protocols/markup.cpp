#include "protocols/markup.hpp"

#include "protocols/text.hpp"

namespace drivebench {

std::string markup(std::string_view text) {
  std::string out;
  for (const char c : utf8(text)) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (c == '"') {
      out += "&quot;";
    } else if (static_cast<unsigned char>(c) >= 0x20 || c == '\n' || c == '\t') {
      out += c;
    } else {
      out += '?';
    }
  }
  return out;
}

}  // namespace drivebench
