// From the registers of a PLC (Modbus TCP) to readings on stdout, a line each,
// for the tags of many valves: the source of `fdi-gateway in --lines -`. See
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
#include <vector>

#include <modbus.h>
#include <unistd.h>

namespace {

struct Tag {
  std::string name;
  int address{0};
  std::string type{};   // u16, i16, u32, f32
  double special{NAN};  // A reading that is none.
  double scale{1.0};
  double last{NAN};  // The last printed value; NaN: there is none.
  bool said{false};

  bool wide() const { return type == "u32" || type == "f32"; }
  int end() const { return address + (wide() ? 2 : 1); }
};

// One request: tags whose registers are close to each other.
struct Block {
  std::vector<Tag*> tags;
  int first{0};
  int end{0};
};

std::vector<Tag> tags;  // By address.
std::vector<Block> blocks;
constexpr const char* kClock = "clock";  // The tag that is the PLC's time.
double newest_s = 0.0;                   // Stamp of the last answer.
long readings = 0, bad = 0, refused = 0, connections = 0;
volatile std::sig_atomic_t stopping = 0;

void Say(const char* what) {
  std::fprintf(stderr,
               "modbus_gateway: %s; readings %ld, bad %ld, refused %ld\n", what,
               readings, bad, refused);
}

// NAME=ADDRESS[:TYPE[:SPECIAL[:SCALE]]]. @returns whether it is one.
bool TakeTag(const char* text) {
  char name[64] = "", type[64] = "u16", special[64] = "-";
  Tag tag;
  const int taken = std::sscanf(text, "%63[^=]=%d:%63[^:]:%63[^:]:%lf", name,
                                &tag.address, type, special, &tag.scale);
  tag.name = name;
  tag.type = type;
  tag.special =
      special[0] == '-' && special[1] == '\0' ? NAN : std::atof(special);
  tags.push_back(tag);
  return taken >= 2 && tag.address >= 0 &&
         (tag.wide() || tag.type == "u16" || tag.type == "i16");
}

void MakeBlocks() {
  std::sort(tags.begin(), tags.end(),
            [](const Tag& a, const Tag& b) { return a.address < b.address; });
  for (Tag& tag : tags) {
    if (blocks.empty() ||
        tag.end() - blocks.back().first > MODBUS_MAX_READ_REGISTERS)
      blocks.push_back({{}, tag.address, tag.address});
    blocks.back().tags.push_back(&tag);
    blocks.back().end = std::max(blocks.back().end, tag.end());
  }
}

double Value(const Tag& tag, const std::uint16_t* at) {
  const std::uint32_t pair = std::uint32_t{at[0]} << 16U | at[1];
  return tag.type == "f32"   ? double{std::bit_cast<float>(pair)}
         : tag.type == "u32" ? 1.0 * pair
         : tag.type == "i16" ? std::int16_t(at[0])
                             : at[0];
}

// By exception: what has not changed is not printed.
void Print(Tag& tag, double value, double stamp_s) {
  const bool usable = std::isfinite(value) && value != tag.special;
  value = usable ? tag.scale * value : NAN;
  if (tag.said && (value == tag.last || (!usable && std::isnan(tag.last))))
    return;
  tag.said = true;
  tag.last = value;
  if (usable)
    std::printf("{\"tag\":\"%s\",\"t\":%.3f,\"v\":%.9g}\n", tag.name.c_str(),
                stamp_s, value);
  else
    std::printf("{\"tag\":\"%s\",\"t\":%.3f,\"q\":\"bad\"}\n", tag.name.c_str(),
                stamp_s);
  ++(usable ? readings : bad);
}

// Nothing is held while the PLC is silent. The stamp is just after the last
// reading.
void PrintBad(const Block& block) {
  for (Tag* tag : block.tags)
    if (tag->name != kClock)
      Print(*tag, NAN, newest_s + 0.001);
}

double Now() {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration<double>(since_1970).count();
}

// All blocks once. @returns whether the connection still stands.
bool Read(modbus_t* plc) {
  std::vector<std::pair<Tag*, double>> values;
  double stamp_s = Now();
  for (const Block& block : blocks) {
    std::uint16_t registers[MODBUS_MAX_READ_REGISTERS + 1] = {};
    if (modbus_read_registers(plc, block.first, block.end - block.first,
                              registers) < 0) {
      if (errno < MODBUS_ENOBASE)
        return false;
      ++refused;  // The PLC has answered, with an exception.
      PrintBad(block);
      continue;
    }
    for (Tag* tag : block.tags) {
      const double value = Value(*tag, &registers[tag->address - block.first]);
      if (tag->name == kClock)
        stamp_s = value;
      else
        values.emplace_back(tag, value);
    }
  }
  for (const auto& [tag, value] : values)
    Print(*tag, value, stamp_s);
  if (!values.empty()) {
    newest_s = stamp_s;
    std::printf("{\"alive\":%.3f}\n", stamp_s);
  }
  stopping = std::fflush(stdout) == 0 ? stopping : SIGPIPE;
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  bool usable = argc > 5;
  for (int i = 5; i < argc; ++i)
    usable = TakeTag(argv[i]) && usable;
  const double poll_s = usable ? std::atof(argv[4]) : 0.0;
  if (!(poll_s > 0.0)) {
    std::fputs("usage: modbus_gateway HOST PORT UNIT POLL_S TAG...\n", stderr);
    return 2;
  }
  MakeBlocks();
  std::signal(SIGPIPE, SIG_IGN);
  for (const int number : {SIGINT, SIGTERM})
    std::signal(number, [](int received) { stopping = received; });
  modbus_t* plc = modbus_new_tcp_pi(argv[1], argv[2]);
  modbus_set_slave(plc, std::atoi(argv[3]));
  for (double pause_s = 1.0; !stopping; pause_s = std::min(60.0, 2 * pause_s)) {
    if (modbus_connect(plc) == 0) {
      pause_s = 1.0;
      if (++connections > 1)
        Say("connected again");
      // Nobody knows what happened meanwhile: all is said again.
      for (Tag& tag : tags)
        tag.said = false;
      do
        usleep(
            static_cast<unsigned>(1e6 * (poll_s - std::fmod(Now(), poll_s))));
      while (!stopping && Read(plc));
      for (const Block& block : blocks)
        PrintBad(block);
      std::fflush(stdout);
    }
    Say(stopping ? "stopped" : modbus_strerror(errno));
    modbus_close(plc);
    stopping || usleep(static_cast<unsigned>(1e6 * pause_s));
  }
  return stopping == SIGPIPE ? 1 : 0;
}
