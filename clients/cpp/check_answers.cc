// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/check_answers.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cpp/connection.h"
#include "silhouette/messages.h"

namespace silhouette::client {

absl::Status NoClearances(const std::string& address) {
  return absl::UnimplementedError(
      absl::StrCat("the server at ", address,
                   " reports no clearances; use a silhouette-server of this version"));
}

absl::Status NoSeparation(const std::string& address) {
  return absl::UnimplementedError(absl::StrCat(
      "the server at ", address, " knows no separation; use a silhouette-server of this version"));
}

absl::Status NoVariants(const std::string& address) {
  return absl::UnimplementedError(absl::StrCat("the server at ", address,
                                               " knows no variants; use a "
                                               "silhouette-server of this version"));
}

absl::Status RequireBasis(const std::string& variant, const v1::Basis& basis,
                          const Connection& connection) {
  const absl::Status same = connection.RequireSameCell(basis);
  if (!same.ok()) return same;
  if (!variant.empty() && basis.variant() != variant) return NoVariants(connection.address());
  if (basis.scene_id() == 0 || basis.has_valid_for()) return absl::OkStatus();
  return absl::UnimplementedError(
      absl::StrCat("the server at ", connection.address(),
                   " does not state how long its answers are valid; use a silhouette-server of "
                   "this version"));
}

namespace {

// A verdict whose clearance was requested has one, unless it is unknown.
absl::Status RequireClearance(const Verdict& verdict, const std::string& address) {
  if (verdict.state == State::kUnknown) return absl::OkStatus();
  if (!verdict.clearance) return NoClearances(address);
  if (!(*verdict.clearance >= 0)) return Malformed(address, "a clearance is not 0 or more");
  return absl::OkStatus();
}

// `bits` bits as words; nothing if the number of bytes is wrong. Further bits are cleared.
std::optional<std::vector<uint64_t>> WordsFrom(const std::string& bytes, size_t bits) {
  static_assert(std::endian::native == std::endian::little);
  if (bytes.size() != (bits + 7) / 8) return std::nullopt;
  std::vector<uint64_t> words((bits + 63) / 64, 0);
  std::memcpy(words.data(), bytes.data(), bytes.size());
  if (bits % 64 != 0) words.back() &= (uint64_t{1} << (bits % 64)) - 1;
  return words;
}

Configuration ConfigurationFrom(const v1::Configuration& message) {
  return {message.positions().begin(), message.positions().end()};
}

}  // namespace

v1::CheckConfigurationsRequest QuestionOf(std::span<const Configuration> configurations,
                                          const Policy& policy, Evidence evidence,
                                          Clearance clearance) {
  v1::CheckConfigurationsRequest request;
  for (const Configuration& q : configurations) *request.add_configurations() = ToMessage(q);
  *request.mutable_policy() = ToMessage(policy);
  request.set_omit_evidence(evidence == Evidence::kOmit);
  request.set_include_clearance(clearance == Clearance::kMeasure);
  return request;
}

namespace {

void Write(const SeparationPolicy& policy, v1::SeparationPolicy& message) {
  if (policy.human_speed) message.set_human_speed(*policy.human_speed);
  if (policy.near_human_speed) message.set_near_human_speed(*policy.near_human_speed);
  if (policy.reaction_time) message.set_reaction_time(*policy.reaction_time);
  if (policy.intrusion) message.set_intrusion(*policy.intrusion);
  if (policy.uncertainty) message.set_uncertainty(*policy.uncertainty);
  if (policy.horizon) message.set_horizon(*policy.horizon);
  for (const SpeedLevel& level : policy.levels) {
    v1::SpeedLevel& added = *message.add_levels();
    added.set_name(level.name);
    added.set_speed(level.speed);
    added.set_stopping_time(level.stopping_time);
    added.set_stopping_distance(level.stopping_distance);
  }
}

Separation SeparationFrom(const v1::Separation& message, RunningClock::time_point asked) {
  return {.level = message.level(),
          .level_name = message.level_name(),
          .distance = message.distance(),
          .segment = message.nearest().segment(),
          .fraction = message.nearest().fraction(),
          .leads_away = message.leads_away(),
          .protective_distances = {message.protective_distances().begin(),
                                   message.protective_distances().end()},
          .image_age = absl::Seconds(message.image_age()),
          .unknown_reason = FromMessage(message.unknown_reason()),
          .valid_until = After(asked, FromMessage(message.valid_for()))};
}

}  // namespace

v1::CheckPathRequest QuestionOf(std::span<const Configuration> waypoints, const Policy& policy,
                                Clearance clearance, std::optional<double> resolution,
                                const std::optional<SeparationPolicy>& separation) {
  v1::CheckPathRequest request;
  for (const Configuration& q : waypoints) *request.add_waypoints() = ToMessage(q);
  *request.mutable_policy() = ToMessage(policy);
  request.set_include_clearance(clearance == Clearance::kMeasure);
  if (resolution) request.set_path_resolution(*resolution);
  if (separation) Write(*separation, *request.mutable_separation());
  return request;
}

absl::StatusOr<ConfigurationChecks> AnswerFrom(const v1::CheckConfigurationsResponse& response,
                                               size_t configurations, Clearance clearance,
                                               RunningClock::time_point asked,
                                               const std::string& address) {
  if (static_cast<size_t>(response.verdicts_size()) != configurations) {
    return Malformed(address, absl::StrCat(response.verdicts_size(), " verdicts for ",
                                           configurations, " configurations"));
  }
  ConfigurationChecks checks{.basis = FromMessage(response.basis(), asked), .verdicts = {}};
  for (const v1::Verdict& verdict : response.verdicts()) {
    checks.verdicts.push_back(FromMessage(verdict, checks.basis));
    if (clearance == Clearance::kOmit) continue;
    const absl::Status measured = RequireClearance(checks.verdicts.back(), address);
    if (!measured.ok()) return measured;
  }
  return checks;
}

absl::StatusOr<NumberChecks> NumbersFrom(const v1::CheckConfigurationsResponse& response,
                                         size_t numbers, RunningClock::time_point asked,
                                         const std::string& address) {
  auto free = WordsFrom(response.free(), numbers);
  auto occupied = WordsFrom(response.occupied(), numbers);
  if (!free || !occupied) {
    return Malformed(address, absl::StrCat("not a verdict for each of ", numbers, " numbers"));
  }
  NumberChecks checks{.basis = FromMessage(response.basis(), asked),
                      .unknown_reason = FromMessage(response.unknown_reason()),
                      .size = numbers,
                      .free = *std::move(free),
                      .occupied = *std::move(occupied)};
  // Free and occupied at once, or without a scene: unknown.
  const bool rests = checks.basis.scene_id != 0 && response.unknown_reason() == 0;
  for (size_t i = 0; i < checks.free.size(); ++i) {
    const uint64_t known = rests ? checks.free[i] ^ checks.occupied[i] : 0;
    checks.free[i] &= known;
    checks.occupied[i] &= known;
  }
  return checks;
}

namespace {

PathProof ProofFrom(v1::PathProof proof) {
  switch (proof) {
    case v1::PATH_PROOF_GRID:
      return PathProof::kGrid;
    case v1::PATH_PROOF_CONTINUOUS:
      return PathProof::kContinuous;
    case v1::PATH_PROOF_SAMPLED:
      return PathProof::kSampled;
    default:
      return PathProof::kNone;
  }
}

}  // namespace

absl::StatusOr<PathCheck> AnswerFrom(const v1::CheckPathResponse& response, Clearance clearance,
                                     RunningClock::time_point asked, const std::string& address) {
  PathCheck check{.basis = FromMessage(response.basis(), asked),
                  .verdict = {},
                  .segment = response.segment(),
                  .fraction = response.fraction(),
                  .configuration = ConfigurationFrom(response.configuration()),
                  .checked = response.checked()};
  check.verdict = FromMessage(response.verdict(), check.basis);
  if (check.verdict.free()) {
    check.proof = ProofFrom(response.proof());
    check.sampled_step = response.sampled_step();
  }
  if (response.has_separation()) check.separation = SeparationFrom(response.separation(), asked);
  if (clearance == Clearance::kOmit) return check;
  const absl::Status measured = RequireClearance(check.verdict, address);
  if (!measured.ok()) return measured;
  if (!check.verdict.free()) return check;
  if (!response.has_narrowest()) {
    return Malformed(address, "it does not state where the clearance is smallest");
  }
  const v1::PathPlace& place = response.narrowest();
  check.narrowest = {.segment = place.segment(),
                     .fraction = place.fraction(),
                     .configuration = ConfigurationFrom(place.configuration())};
  return check;
}

void MakeUnknown(PathCheck& check, Reason reason) {
  check = {.basis = std::move(check.basis),
           .verdict = {.reason = reason},
           .configuration = {},
           .separation = std::move(check.separation)};
}

RunningClock::time_point MadeAt(const v1::Basis& basis, RunningClock::time_point asked,
                                ServerClock& clock, const v1::Separation& separation) {
  const RunningClock::time_point received = RunningClock::now();
  absl::Duration enough = FromMessage(basis.valid_for());
  if (enough <= absl::ZeroDuration()) return asked;
  if (separation.has_valid_for()) {
    enough = std::min(enough, FromMessage(separation.valid_for()) / 2);
  }
  if (received < After(asked, enough)) return asked;
  const auto earliest = clock.MadeAt(basis, received);
  return earliest.ok() ? std::max(asked, *earliest) : asked;
}

namespace {

// What is unknown already keeps its reason.
void Outdate(Verdict& verdict) {
  if (verdict.state != State::kUnknown) verdict = {.reason = Reason::kAnswerLate};
}

}  // namespace

bool DropIfExpired(Basis& basis) {
  const RunningClock::time_point now = RunningClock::now();
  if (now < basis.valid_until) return false;
  // Else nothing was valid when it was made, for reasons that the server states.
  if (basis.valid_until > basis.asked) {
    basis.defects.push_back(
        {Reason::kAnswerLate,
         absl::StrFormat("the answer was valid for %.2f s and came after %.2f s: ask again, and "
                         "look for what holds up the network, this computer or new scenes",
                         absl::ToDoubleSeconds(absl::FromChrono(basis.valid_until - basis.asked)),
                         absl::ToDoubleSeconds(absl::FromChrono(now - basis.asked)))});
  }
  return true;
}

void DropIfExpired(ConfigurationChecks& checks) {
  if (!DropIfExpired(checks.basis)) return;
  for (Verdict& verdict : checks.verdicts) Outdate(verdict);
}

void DropIfExpired(NumberChecks& checks) {
  if (!DropIfExpired(checks.basis)) return;
  checks.free.assign(checks.free.size(), 0);
  checks.occupied.assign(checks.occupied.size(), 0);
  if (checks.unknown_reason == Reason::kUnspecified) checks.unknown_reason = Reason::kAnswerLate;
}

void DropIfExpired(PathCheck& check) {
  const bool expired = DropIfExpired(check.basis);
  // What is unknown already keeps its reason and place.
  if (expired && check.verdict.state != State::kUnknown) MakeUnknown(check, Reason::kAnswerLate);
}

void DropIfExpired(Explanation& explanation) {
  if (DropIfExpired(explanation.basis)) Outdate(explanation.verdict);
}

absl::Duration Basis::Age() const {
  if (scene_id == 0) return absl::InfiniteDuration();
  return scene_age + absl::FromChrono(RunningClock::now() - asked);
}

bool ConfigurationChecks::AllFree() const {
  return !verdicts.empty() && std::all_of(verdicts.begin(), verdicts.end(),
                                          [](const Verdict& verdict) { return verdict.free(); });
}

}  // namespace silhouette::client
