#pragma once

#include <cstdint>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"

namespace fdi::bench {

/// Model sets of the shape of trained ones, their numbers from a fixed seed, so
/// that a benchmark needs no data. The valve is one that follows its command,
/// X = CV, with F = 100 − X + (P1 − P2)/100; every fault shifts X or F.

/// As the preset `paper`: X from CV and P2, 5 rules; F from CV, P1, P2 and its
/// own past, 1 to 5 rules; each model with antecedents of its own.
ModelSet PaperSet(int observers);

/// As the preset `extended`: X, F, F(CV) with 24, 12 and 24 rules, of which two
/// or three fire at a time, T1, P1, P2 with one rule. The observers of a
/// channel share their antecedents. 19 faults.
ModelSet ExtendedSet(int observers);

/// Samples 1 s apart under a slow sine on CV, with noise, that start `phase`
/// seconds into it.
/// @param shift added to F: a fault, if it is beyond the noise.
std::vector<Sample> Samples(int count, int phase, double shift);

}  // namespace fdi::bench
