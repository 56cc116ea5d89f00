#pragma once

#include "trainer/gustafson_kessel.h"

namespace fdi::trainer {

/// The criterion of [Sugeno & Yasukawa, 1993] for the number of clusters,
///
///     S(c) = Σₖ Σᵢ μₖᵢᵐ (‖zₖ − vᵢ‖² − ‖vᵢ − z̄‖²),
///
/// small where clusters are compact and far apart. One cluster,
/// v₁ = z̄ and μ = 1, gives the total scatter.
///
/// @param points Z, N×n: the points that were clustered.
/// @param fuzziness m.
/// @throws std::invalid_argument if the sizes do not match.
///
/// - [Sugeno & Yasukawa, 1993] "A fuzzy-logic-based approach to qualitative
///   modeling", IEEE Trans. Fuzzy Systems 1(1), pp. 7–31.
double SugenoYasukawa(const Eigen::Ref<const Eigen::MatrixXd>& points,
                      const FuzzyPartition& partition, double fuzziness = 2.0);

}  // namespace fdi::trainer
