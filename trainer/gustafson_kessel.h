#pragma once

#include <vector>

#include <Eigen/Core>

#include "diagnosis/model/ts_model.h"

namespace fdi::trainer {

/// Settings of FitGustafsonKessel(). The defaults suit unit-variance data.
struct GustafsonKesselOptions {
  int num_clusters{3};            ///< c ≥ 2.
  double fuzziness{2.0};          ///< m > 1 [-]; larger is softer.
  double tolerance{1e-3};         ///< Stop once max|ΔU| falls below it [-].
  int min_iterations{10};         ///< Before the tolerance counts.
  int max_iterations{200};        ///< ≥ 1.
  double covariance_weight{0.0};  ///< γ in [0, 1]: share of F₀ in every Fᵢ.
  double max_condition{1e12};     ///< β ≥ 1, bound on cond(Fᵢ) [-].
  int num_starts{3};              ///< ≥ 1; the start with the lowest J wins.
  int coarse_points{500};         ///< For choosing a start; 0: all points.
  int seed{1};                    ///< For the first random start; >= 0.
};

/// A fuzzy partition of N points in n dimensions into c clusters.
struct FuzzyPartition {
  Eigen::MatrixXd memberships;               ///< U, N×c; each row sums to 1.
  Eigen::MatrixXd centers;                   ///< V, c×n; units of the data.
  std::vector<Eigen::MatrixXd> covariances;  ///< F₁…F_c, each n×n, s.p.d.
  double objective{0.0};                     ///< J(U, V).
  int iterations{0};                         ///< In the start that won.
  bool converged{false};  ///< False if max_iterations came first.
  bool separated{false};  ///< False if every start fell onto the trivial
                          ///< partition: no μ exceeds 1/c by 0.1.
};

/// Clusters `points` with ellipsoids of equal volume by alternately minimizing
///
///     J(U,V) = Σᵢ Σₖ μₖᵢᵐ Dᵢₖ,  Dᵢₖ = (zₖ − vᵢ)ᵀ Aᵢ (zₖ − vᵢ),
///     Aᵢ = det(Fᵢ)^(1/n) Fᵢ⁻¹,  Fᵢ = Σₖ μₖᵢᵐ (zₖ − vᵢ)(zₖ − vᵢ)ᵀ / Σₖ μₖᵢᵐ,
///     μₖᵢ = 1 / Σⱼ (Dᵢₖ / Dⱼₖ)^(1/(m−1)),
///
/// after [Gustafson & Kessel, 1978]. In every iteration Fᵢ is replaced by
/// (1 − γ) Fᵢ + γ det(F₀)^(1/n) I, F₀ the covariance of all points, and its
/// eigenvalues below λmax/β are raised to λmax/β [Babuška et al., 2002], so
/// that collinear data stay solvable.
///
/// Starts are random partitions and, every second one, spheres about points
/// far from each other. They compete on about `coarse_points` of the points,
/// evenly taken from the sorted ones, at ten times the tolerance; the best is
/// iterated further on all. The order of the rows does not matter, since the
/// points are sorted first.
/// Not converging is a result, not an error: read FuzzyPartition::converged.
///
/// @param points Z, N×n: one sample zₖ per row, every column scaled to
///   comparable variance [-]. N > num_clusters.
/// @throws std::invalid_argument if `points` has too few rows or a value that
///   is not finite, or if an option is out of its range.
///
/// - [Gustafson & Kessel, 1978] "Fuzzy clustering with a fuzzy covariance
///   matrix", Proc. IEEE Conf. Decision and Control, San Diego, pp. 761–766.
/// - [Babuška et al., 2002] R. Babuška, P. J. van der Veen, U. Kaymak,
///   "Improved covariance estimation for Gustafson-Kessel clustering",
///   Proc. FUZZ-IEEE, Honolulu, pp. 1081–1085.
FuzzyPartition FitGustafsonKessel(
    const Eigen::Ref<const Eigen::MatrixXd>& points,
    const GustafsonKesselOptions& options = {});

/// Makes the distance to a cluster in the space of its antecedents,
///
///     log β(x) = −½ (x − v)ᵀ F⁻¹ (x − v) = −½ ‖L (x − v)‖²,   F⁻¹ = LᵀL,
///
/// the premise of a rule: fills center and metric and sets every antecedent to
/// 1 everywhere.
///
/// @param columns m regressors among those of the rule, ascending.
/// @param center v, m; in the units of the regressors.
/// @param covariance F, m×m, s.p.d.
/// @param num_regressors n ≥ m, in the rule.
/// @throws std::invalid_argument if sizes differ or F is not s.p.d.
void PlaceByDistance(const std::vector<Eigen::Index>& columns,
                     const Eigen::Ref<const Eigen::VectorXd>& center,
                     const Eigen::Ref<const Eigen::MatrixXd>& covariance,
                     Eigen::Index num_regressors, TsRule& rule);

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
