// The plant of a pair of monitors, for pair.sh: publishes, subscribes, and says
// what a take-over cost. Commands come from standard input, one a line:
//
//     ready S      waits up to S seconds until both settled; prints the process
//                  id of the leader, or 0
//     mark         from here on
//     late         waits for the next vectors of all valves; prints their
//                  median and worst delay [ms], and how many valves had none
//     faulty       the faulty valves fail; waits until all are isolated
//     totals       prints what Count() says, as key=value
//
// Usage: pair_rounds prepare DATA | pair_rounds run ADDRESS DOMAIN VALVES
// FAULTY
#include <cstdio>
#include <iostream>
#include <sstream>

#include "tests/survival/pair_plant.h"

namespace {

using fdi::monitor::Await;
using fdi::monitor::PairPlant;
using Clock = PairPlant::Clock;

void Say(const std::string& line) {
  std::cout << line << std::endl;  // A script waits for it.
}

std::string Totals(const PairPlant::Totals& t) {
  std::ostringstream text;
  text << "samples=" << t.samples << " missing=" << t.missing
       << " twice=" << t.twice << " over_500ms=" << t.over_500ms
       << " worst_ms=" << t.worst_ms << " episodes=" << t.episodes
       << " transitions=" << t.transitions << " repeats=" << t.repeats
       << " transitions_twice=" << t.transitions_twice
       << " twice_of=" << t.twice_of;
  return text.str();
}

int Run(const fdi::idl::DdsOptions& dds, int valves, int faulty) {
  PairPlant plant(dds, valves, faulty, std::chrono::milliseconds(1000));
  Clock::time_point mark = Clock::now();
  std::string line;
  while (std::getline(std::cin, line)) {
    std::istringstream words(line);
    std::string command;
    int seconds = 0;
    words >> command >> seconds;
    if (command == "ready") {
      const bool settled =
          Await([&] { return plant.Settled(); }, std::chrono::seconds(seconds));
      const auto leaders = plant.Leaders();
      Say(settled && leaders.size() == 1 ? leaders.front() : "0");
    } else if (command == "mark") {
      mark = Clock::now();
      Say("ok");
    } else if (command == "late") {
      Await([&] { return plant.NextVectors(mark).missing == 0; },
            std::chrono::seconds(10));
      const PairPlant::Delay delay = plant.NextVectors(mark);
      Say(std::to_string(delay.median) + " " + std::to_string(delay.worst) +
          " " + std::to_string(delay.missing));
    } else if (command == "faulty") {
      plant.CountFromNow();
      plant.SetFaulty(true);
      Await(
          [&] { return plant.Isolated() >= static_cast<std::size_t>(faulty); },
          std::chrono::seconds(60));
      Say(std::to_string(plant.Isolated()));
    } else if (command == "totals") {
      Say(Totals(plant.Count()));
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv, argv + argc);
  if (argc == 3 && words[1] == "prepare") {
    fdi::monitor::StorePairModels(words[2]);
    return 0;
  }
  if (argc != 6 || words[1] != "run") {
    std::cerr << "usage: pair_rounds prepare DATA | pair_rounds run ADDRESS "
                 "DOMAIN VALVES FAULTY\n";
    return 2;
  }
  fdi::idl::DdsOptions dds;
  dds.interfaces = words[2];
  dds.domain = std::stoi(words[3]);
  return Run(dds, std::stoi(words[4]), std::stoi(words[5]));
}
