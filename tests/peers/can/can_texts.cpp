// For tests/peers/can/test_can_dbc.py: the library's texts about its CAN messages, and frames with their
// values.
//
//   can_texts dbc|table|frames classic|fd standard|extended narrow|wide
//
// With `wide` the first and the last of three axes are wide. A line of `frames`: identifier, data, then
// NAME=VALUE for each field that is in the frame.
#include <cstdio>
#include <cstring>
#include <random>

#include "protocols/can/codec.hpp"
#include "protocols/can/dbc.hpp"
#include "protocols/can/formats/text.hpp"
#include "protocols/can/table_text.hpp"
#include "protocols/text.hpp"

namespace {
using namespace drivebench::can;
using drivebench::shortest;

void print_frames(const Profile& profile, std::span<const BusAxis> axes) {
  constexpr int kFramesOfEach = 200;
  std::mt19937_64 random(3);
  for (const MessageRow* row : rows_of(profile, axes)) {
    for (int i = 0; i < kFramesOfEach; ++i) {
      Frame frame;
      for (std::size_t byte = 0; byte < row->size; ++byte)
        frame.data[byte] = static_cast<std::uint8_t>(random() % 4 == 0 ? 0xFF : random());
      if (is_paged(*row)) frame.data[0] %= kPages;
      for (const Field& field : row->fields) {
        if (field.name == "mode") frame.data[field.start_bit / 8U] %= kCurrentMode + 2;
      }
      const Values carried = decode(*row, profile, frame);
      std::size_t axis = random() % axes.size();
      while (!has_message(axes[axis], *row))
        axis = (axis + 1) % axes.size();
      frame = encode(*row, profile, axes[axis].node, carried);  // without reserved bytes
      std::string line;
      append_id(line, frame);
      line += " ";
      append_data(line, frame);
      for (std::size_t field = 0; field < row->fields.size(); ++field) {
        if (!is_on_page(row->fields[field], frame.data[0])) continue;
        line += " " + std::string(row->fields[field].name) + "=" + shortest(carried[field]);
      }
      std::puts(line.c_str());
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  Profile profile;
  profile.fd = std::strcmp(argv[2], "fd") == 0;
  profile.choose_ids(IdSet::kFree, std::strcmp(argv[3], "extended") == 0);
  if (profile.extended) profile.base_ids[static_cast<std::size_t>(Message::kCommand)] = 0x12340000;
  profile.edge_time_unit_s = 2.5e-7;
  profile.wide = std::strcmp(argv[4], "wide") == 0;
  const std::vector<BusAxis> axes = {{"servo", 1, profile.wide},
                                     {"2nd \"load\" drive with a long name", 2, false},
                                     {"2nd \"load\" drive too", kMaxFreeNode, profile.wide}};
  if (std::strcmp(argv[1], "dbc") == 0)
    std::fputs(dbc_text("Zwei \"Achsen\" \xC3\xA4", profile, axes,
                        bus_load(profile,
                                 {.axes = axes.size(), .wide_axes = profile.wide ? 2U : 0U, .period_s = 2e-3})
                            .messages)
                   .c_str(),
               stdout);
  else if (std::strcmp(argv[1], "table") == 0)
    std::fputs(table_text("two axes", profile, axes).c_str(), stdout);
  else
    print_frames(profile, axes);
}
