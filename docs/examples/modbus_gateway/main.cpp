// From the registers of a PLC (Modbus TCP) to CSV lines on stdout, one a sample
// period, which `fdi-simulator replay --file -` publishes on DDS. See
// README.md.
#include <algorithm>
#include <bit>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include <modbus.h>
#include <unistd.h>

namespace {

struct Tag {
  std::string name;
  int address{0};
  std::string type{};   // u16, i16, u32, f32
  bool wide{false};     // Two registers, the high word first.
  double special{NAN};  // A reading that is none; of a mode, AUTO.
};

std::vector<Tag> tags;
Tag plc_clock;               // Seconds since 1970.
int first = 65536, end = 0;  // The registers that are read.
double period_s = 1.0;
std::uint16_t registers[MODBUS_MAX_READ_REGISTERS + 1];
long rows = 0, lost = 0, bad = 0, refused = 0, last_row = -1;
volatile std::sig_atomic_t stopping = 0;

void Say(const char* what) {
  std::fprintf(stderr,
               "modbus_gateway: %s; rows %ld, lost %ld, bad %ld, refused %ld\n",
               what, rows, lost, bad, refused);
}

// NAME=ADDRESS[:TYPE[:SPECIAL]]. @returns whether it is one.
bool TakeTag(const char* text) {
  char name[64] = "", type[64] = "u16";
  Tag tag;
  const int taken = std::sscanf(text, "%63[^=]=%d:%63[^:]:%lf", name,
                                &tag.address, type, &tag.special);
  tag.name = name;
  tag.type = type;
  tag.wide = tag.type == "u32" || tag.type == "f32";
  first = std::min(first, tag.address);
  end = std::max(end, tag.address + (tag.wide ? 2 : 1));
  tag.name == "clock" ? void(plc_clock = tag) : tags.push_back(tag);
  return taken >= 2 && (tag.wide || tag.type == "u16" || tag.type == "i16");
}

double Value(const Tag& tag) {
  const std::uint16_t* at = &registers[tag.address - first];
  const std::uint32_t pair = std::uint32_t{at[0]} << 16U | at[1];
  return tag.type == "f32"   ? double{std::bit_cast<float>(pair)}
         : tag.type == "u32" ? 1.0 * pair
         : tag.type == "i16" ? std::int16_t(at[0])
                             : at[0];
}

// A number, or a word that the reader of the lines takes for "no reading".
std::string Cell(const Tag& tag) {
  const bool special = Value(tag) == tag.special;
  if (tag.name == "mode")
    return special ? "AUTO" : "MANUAL";
  char text[32] = "Bad";
  if (std::isfinite(Value(tag)) && !special)
    std::snprintf(text, sizeof text, "%.9g", Value(tag));
  bad += text[0] == 'B';
  return text;
}

void WriteRow(long row) {
  // Seconds since 1970, to the millisecond: [time] of the map says so.
  std::printf("%.3f", static_cast<double>(row) * period_s);
  for (const Tag& tag : tags)
    std::printf(",%s", Cell(tag).c_str());
  std::printf("\n");
  stopping = std::fflush(stdout) == 0 ? stopping : SIGPIPE;
  lost += last_row < 0 ? 0 : row - last_row - 1;
  last_row = row;
  ++rows;
}

double Now() {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration<double>(since_1970).count();
}

// Until the connection is lost.
void Follow(modbus_t* plc, double poll_s) {
  for (bool again = last_row >= 0; !stopping;) {
    usleep(static_cast<unsigned>(1e6 * (poll_s - std::fmod(Now(), poll_s))));
    const double now_s = Now();  // Of the request: on the grid.
    if (modbus_read_registers(plc, first, end - first, registers) < 0) {
      if (errno < MODBUS_ENOBASE)
        return;
      ++refused;  // The PLC has answered, with an exception.
      continue;
    }
    const double stamp_s = plc_clock.name.empty() ? now_s : Value(plc_clock);
    const long row = std::lround(std::floor(stamp_s / period_s + 1e-6));
    if (row <= last_row)
      continue;  // Its clock has not gone on yet.
    WriteRow(row);
    if (std::exchange(again, false))
      Say("connected again");
  }
}

}  // namespace

int main(int argc, char** argv) {
  bool usable = argc > 6;
  for (int i = 6; i < argc; ++i)
    usable = TakeTag(argv[i]) && usable;
  period_s = usable ? std::atof(argv[4]) : 0.0;
  const double poll_s = usable ? std::atof(argv[5]) : 0.0;
  if (!(period_s > 0.0 && poll_s > 0.0 && first >= 0 &&
        end - first <= MODBUS_MAX_READ_REGISTERS)) {
    std::fputs("usage: modbus_gateway HOST PORT UNIT PERIOD_S POLL_S TAG...\n",
               stderr);
    return 2;
  }
  std::signal(SIGPIPE, SIG_IGN);
  for (const int number : {SIGINT, SIGTERM})
    std::signal(number, [](int received) { stopping = received; });
  std::printf("time");
  for (const Tag& tag : tags)
    std::printf(",%s", tag.name.c_str());
  std::printf("\n");
  modbus_t* plc = modbus_new_tcp_pi(argv[1], argv[2]);
  modbus_set_slave(plc, std::atoi(argv[3]));
  for (double pause_s = 1.0; !stopping; pause_s = std::min(60.0, 2 * pause_s)) {
    const long before = rows;
    if (modbus_connect(plc) == 0)
      Follow(plc, poll_s);
    Say(stopping ? "stopped" : modbus_strerror(errno));
    modbus_close(plc);
    pause_s = rows > before ? 1.0 : pause_s;
    stopping || usleep(static_cast<unsigned>(1e6 * pause_s));
  }
  return stopping == SIGPIPE ? 1 : 0;
}
