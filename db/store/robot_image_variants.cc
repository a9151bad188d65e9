// SPDX-License-Identifier: Apache-2.0
// The variants of a database: which there are, making and removing them.
#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "db/status/status_macros.h"
#include "db/store/database_state.h"
#include "db/store/schema.h"
#include "db/store/store.h"

namespace silhouette {
namespace {

// The payload of schema::kVariantsKey: all names but that of the default variant.
std::string VariantsPayload(const std::vector<std::string>& names) {
  storage::v1::RobotImageVariants variants;
  for (const std::string& name : names) {
    if (name != schema::kDefaultVariant) variants.add_names(name);
  }
  return variants.SerializeAsString();
}

}  // namespace

const std::string& Database::variant() const { return state_->places.name; }

absl::StatusOr<std::vector<std::string>> Database::Variants() const {
  Environment& environment = *state_->environment;
  ASSIGN_OR_RETURN(const ReadTransaction transaction, environment.Read());
  const auto hold = environment.HoldMap();
  return silhouette::ReadVariants(environment, transaction.get());
}

absl::StatusOr<std::unique_ptr<Database>> Database::OpenVariant(const std::string& name) const {
  ASSIGN_OR_RETURN(const std::vector<std::string> names, Variants());
  const schema::VariantPlaces places = schema::PlacesOfVariant(name);
  ASSIGN_OR_RETURN(const auto images, state_->environment->Find(places.robot_images));
  if (std::ranges::find(names, name) == names.end() || !images) {
    return absl::NotFoundError(absl::StrCat("database '", path(), "' has no variant '", name,
                                            "'; its variants are ", "'",
                                            absl::StrJoin(names, "', '"), "'"));
  }
  return std::unique_ptr<Database>(
      new Database(std::make_shared<DatabaseState>(*state_, places, *images)));
}

absl::StatusOr<std::unique_ptr<Database>> Database::CreateVariant(const std::string& name,
                                                                  const std::string& program) {
  if (!schema::IsVariantName(name)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "a variant cannot be named '", name, "': a name has 1 to 32 of a-z, 0-9, '_' and '-'"));
  }
  RETURN_IF_ERROR(CheckWritable(*state_));
  ASSIGN_OR_RETURN(std::vector<std::string> names, Variants());
  if (std::ranges::find(names, name) != names.end()) {
    return absl::AlreadyExistsError(
        absl::StrCat("database '", path(), "' has a variant '", name, "' already"));
  }
  if (names.size() >= schema::kMaxVariants) {
    return absl::FailedPreconditionError(
        absl::StrCat("database '", path(), "' has ", names.size(),
                     " variants, as many as there may be; remove one, or make another database"));
  }
  // Empty and of no variant, if the change after it is not made.
  RETURN_IF_ERROR(state_->environment->Make(schema::PlacesOfVariant(name).robot_images).status());
  names.push_back(name);
  RETURN_IF_ERROR(ChangeMeta(schema::kVariantsKey, VariantsPayload(names), program));
  return OpenVariant(name);
}

absl::Status Database::RemoveVariant(const std::string& name, const std::string& program) {
  if (name == schema::kDefaultVariant) {
    return absl::InvalidArgumentError("the default variant cannot be removed: others rest on it");
  }
  RETURN_IF_ERROR(OpenVariant(name).status());
  ASSIGN_OR_RETURN(const WriterTurn turn, WriterTurn::Take(*state_));
  const schema::VariantPlaces places = schema::PlacesOfVariant(name);
  Environment& environment = *state_->environment;
  std::vector<MDB_dbi> emptied;
  for (const std::string& place :
       {places.robot_images, places.collision_index, places.raw_images}) {
    ASSIGN_OR_RETURN(const auto database, environment.Find(place));
    if (database) emptied.push_back(*database);
  }
  storage::v1::Provenance entry = NewProvenance(absl::Now(), program, 0);
  entry.set_variant(name);
  return WriteChange(*state_, 0, entry, [&](WriteTransaction& transaction) -> absl::Status {
    ASSIGN_OR_RETURN(std::vector<std::string> names,
                     silhouette::ReadVariants(environment, transaction.get()));
    std::erase(names, name);
    // The sub-databases stay, empty: others of this process may use them.
    for (const MDB_dbi database : emptied) {
      const int code = mdb_drop(transaction.get(), database, 0);
      if (code != 0) return environment.WriteError(code);
    }
    RETURN_IF_ERROR(
        WriteMeta(environment, transaction, schema::kVariantsKey, VariantsPayload(names)));
    RETURN_IF_ERROR(transaction.Delete(environment.meta(), places.drawn_key));
    return transaction.Delete(environment.meta(), places.capture_key);
  });
}

}  // namespace silhouette
