#include "monitor/pair_election.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace fdi::monitor {

PairElection::PairElection(PairState self, Duration patience,
                           Duration listening, TimePoint now)
    : self_(std::move(self)),
      patience_(patience),
      stepped_(now),
      listen_until_(now + listening) {}

bool PairElection::Heard(const PairState& word, TimePoint now) {
  if (word.pair != self_.pair || word.instance == self_.instance) {
    return false;
  }
  const auto [found, fresh] =
      heard_.try_emplace(word.instance, Other{word, now, now, std::nullopt});
  Other& other = found->second;
  if (word.received != other.word.received) {
    other.received = now;
    other.deaf_since.reset();
  }
  other.word = word;
  other.heard = now;
  return true;
}

// A leader that receives nothing while we do is alive and yet has nothing to
// publish. Samples often come in bursts, so ours may arrive somewhat before or
// after the leader's: only a lag of more than half the patience counts.
bool PairElection::Sound(const Other& other, TimePoint now) const {
  const bool deaf = other.deaf_since && now - *other.deaf_since > patience_;
  return !other.word.leaving && now - other.heard <= patience_ && !deaf;
}

bool PairElection::Better(const PairState& a, const PairState& b) {
  return std::tuple(-a.judged, a.rank, a.instance) <
         std::tuple(-b.judged, b.rank, b.instance);
}

void PairElection::Step(std::uint64_t received, int judged, TimePoint now) {
  if (now - std::exchange(stepped_, now) > patience_) {
    Lapse(now);
  }
  if (std::exchange(self_.received, received) != received) {
    for (auto& [instance, other] : heard_) {
      if (!other.deaf_since && now - other.received > patience_ / 2) {
        other.deaf_since = now;
      }
    }
  }
  self_.judged = judged;
  leader_.clear();
  twin_.clear();
  others_ = 0;
  int better = 0;
  const PairState* rival = nullptr;
  for (const auto& [instance, other] : heard_) {
    if (!Sound(other, now)) {
      continue;
    }
    ++others_;
    better += Better(other.word, self_) ? 1 : 0;
    if (other.word.rank == self_.rank) {
      twin_ = other.word.monitor;
    }
    if (other.word.leads && (rival == nullptr || Better(other.word, *rival))) {
      rival = &other.word;
    }
  }
  std::erase_if(heard_, [&](const auto& each) {
    return now - each.second.heard > 100 * patience_;
  });
  if (self_.leaving || (rival != nullptr && Better(*rival, self_))) {
    self_.leads = false;
  }
  if (rival != nullptr || self_.leads || now < listen_until_) {
    leaderless_.reset();
  } else {
    leaderless_ = leaderless_.value_or(now);
    self_.leads = !self_.leaving && now - *leaderless_ >= better * patience_;
  }
  if (self_.leads) {
    leader_ = self_.monitor;
  } else if (rival != nullptr) {
    leader_ = rival->monitor;
  }
}

void PairElection::Lapse(TimePoint now) {
  self_.leads = false;
  listen_until_ = now + patience_;
}

void PairElection::Leave(TimePoint now) {
  Step(self_.received, self_.judged, now);
  if (others_ > 0) {
    self_.leaving = true;
    self_.leads = false;
  }
}

}  // namespace fdi::monitor
