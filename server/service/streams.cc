// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "server/collision/clearance.h"
#include "server/collision/policy.h"
#include "server/service/answers.h"
#include "server/service/calls.h"
#include "server/service/defects.h"
#include "server/service/messages.h"
#include "server/service/space_writer.h"
#include "server/service/streams.h"

namespace silhouette {

absl::StatusOr<bool> PathWatch::Prepare() {
  const Moment now = serving().settings.clock();
  const Served served = serving().scenes.Newest(now);
  const WatchedState state(served, BlockedReason(served, serving().settings.scene, now),
                           CalibrationReason(served, now));
  if (state == told_of_) return false;
  v1::WatchPathResponse update;
  RETURN_IF_ERROR(Answer(
      serving(), path_->request, [this] { return cancelled(); }, update.mutable_check()));
  const uint64_t scene = update.check().basis().scene_id();
  update.set_skipped_scenes(ScenesSkipped(last_scene_, scene));
  told_of_ = state;
  last_scene_ = std::max(last_scene_, scene);
  path_->Note(update, DurationFrom(update.check().basis().server_clock()));
  serving().watched_paths.CountAnswer();
  update_ = std::move(update);
  return true;
}

bool PathWatch::NextPart(v1::WatchPathResponse& part) {
  part = std::move(update_);
  return false;
}

namespace {

constexpr std::chrono::milliseconds kBetweenImages{200};
constexpr int kRecordedImageWidth = 640;

}  // namespace

SceneWatch::SceneWatch(Serving& serving, grpc::CallbackServerContext* context, Clients::Place place,
                       const v1::WatchScenesRequest& request)
    : WatchWriter(serving, context, std::move(place)),
      include_images_(request.include_images() && serving.settings.live != nullptr) {
  if (include_images_) serving.settings.live->KeepImages();
}

uint64_t SceneWatch::Beside() const { return serving().watched_paths.changes(); }

absl::StatusOr<bool> SceneWatch::Prepare() {
  const Moment now = serving().settings.clock();
  parts_.clear();
  AddState(now);
  AddScenes();
  AddImages();
  AddPaths();
  std::ranges::reverse(parts_);
  return !parts_.empty();
}

bool SceneWatch::NextPart(v1::WatchScenesResponse& part) {
  part = std::move(parts_.back());
  parts_.pop_back();
  return !parts_.empty();
}

void SceneWatch::AddState(const Moment& now) {
  const ServingSettings& settings = serving().settings;
  const Served served = serving().scenes.Newest(now);
  const Reason blocked = BlockedReason(served, settings.scene, now);
  WatchedState state(served, blocked, CalibrationReason(served, now));
  state.scene = 0;  // scenes are sent for themselves
  if (state == told_of_) return;
  told_of_ = state;
  v1::ServedState& told = *parts_.emplace_back().mutable_state();
  told.set_database_generation(served.database->generation());
  told.set_unknown_reason(ToMessage(blocked));
  if (blocked != Reason::kNone) {
    for (const SceneDefect& defect : DefectsOf(served, blocked, settings, now)) {
      ToMessage(defect, told.add_defects());
    }
  }
  for (const AllowedRegion& region : served.regions->regions) {
    ToMessage(region, *served.database, now, told.add_regions());
  }
}

void SceneWatch::AddScenes() {
  const SharedScene newest = serving().scenes.Find(0);
  if (newest == nullptr || newest->id == last_scene_) return;
  uint64_t id = newest->id;
  if (last_scene_ != 0) {
    id = std::max(last_scene_ + 1, id - std::min(id, SceneStore::kKept) + 1);
  }
  for (; id <= newest->id; ++id) {
    const SharedScene scene = id == newest->id ? newest : serving().scenes.Find(id);
    if (scene == nullptr) continue;
    ToMessage(*scene, /*include_planes=*/true, scene->defects,
              parts_.emplace_back().mutable_scene());
  }
  last_scene_ = newest->id;
}

void SceneWatch::AddImages() {
  if (!include_images_) return;
  const std::shared_ptr<const LiveImages> images = serving().settings.live->images();
  const auto now = std::chrono::steady_clock::now();
  if (images == nullptr || images->scene <= last_images_) return;
  if (now - images_sent_ < kBetweenImages) return;
  last_images_ = images->scene;
  images_sent_ = now;
  v1::WatchScenesResponse& part = parts_.emplace_back();
  part.set_images_scene(images->scene);
  const std::shared_ptr<const ServedDatabase> database = serving().scenes.database();
  const size_t views = std::min(images->images.size(), static_cast<size_t>(database->views()));
  for (size_t view = 0; view < views; ++view) {
    if (!images->images[view]) continue;
    v1::CameraPicture& picture = *part.add_images();
    picture.set_view(database->view_name(static_cast<int>(view)));
    picture.set_jpeg(JpegOf(*images->images[view], kRecordedImageWidth));
  }
}

void SceneWatch::AddPaths() {
  std::map<uint64_t, std::shared_ptr<const WatchedPath::Told>> ended = std::move(told_paths_);
  told_paths_.clear();
  for (const std::shared_ptr<const WatchedPath>& path : serving().watched_paths.All()) {
    const auto told = path->told();
    const auto before = ended.extract(path->id);
    if (told == nullptr) continue;
    told_paths_.emplace(path->id, told);
    if (!before.empty() && before.mapped() == told) continue;
    v1::WatchedPath& added = *parts_.emplace_back().add_paths();
    added.set_id(path->id);
    added.set_client(path->client);
    *added.mutable_request() = path->request;
    *added.mutable_answer() = told->response;
  }
  for (const auto& [id, told] : ended) {
    v1::WatchedPath& gone = *parts_.emplace_back().add_paths();
    gone.set_id(id);
    gone.set_ended(true);
  }
}

namespace {

absl::Status CheckWatched(const ServedDatabase& database, size_t tiles) {
  if (!DrawsMaps(database) || tiles <= kMaxDrawnTiles) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "tiles: the robot's images are drawn and not stored, so each scene's map is drawn again; "
      "there are ",
      tiles, " tiles, watch at most ", kMaxDrawnTiles, ", or check configurations and paths"));
}

// Whether a watch that asks for obstacles gets those of a drawn robot.
absl::StatusOr<bool> GivesObstacles(const v1::WatchConfigurationSpaceRequest& request,
                                    const ServedDatabase& database, const Policy& policy) {
  if (!request.obstacles() || database.robot_images().drawn() == nullptr) return false;
  if (!IsCalibrated(policy.preset) && !IsSound(policy.preset)) return true;
  return absl::FailedPreconditionError(absl::StrCat(
      "obstacles: planes alone do not decide under the preset '", NameOf(policy.preset),
      "'; request 'uncalibrated' or 'paper', or have the server check each configuration"));
}

void AddPlanes(const Served& served, const Policy& policy,
               v1::WatchConfigurationSpaceResponse* message) {
  message->set_min_views(MinViews(policy, served.database->views()));
  const auto planes = ObstaclePlanes(served.scene->obstacle_images);
  for (size_t view = 0; view < planes.size(); ++view) {
    v1::ObstaclePlane& plane = *message->add_planes();
    plane.set_view(served.database->view_name(static_cast<int>(view)));
    plane.set_missing(!planes[view]);
    if (planes[view]) ToMessage(*planes[view], plane.mutable_mask());
  }
}

// The map of a scene, worked out for these tiles, with free cells if asked for; null: there is no
// scene, or no tile. Cancelled: it was given up.
absl::StatusOr<std::shared_ptr<const ConfigurationSpace>> WorkedOut(
    Serving& serving, const Served& served, const Policy& policy,
    const std::vector<uint64_t>& tiles, bool cells, const Stop& stop) {
  if (served.scene == nullptr || tiles.empty()) return nullptr;
  std::shared_ptr<const ConfigurationSpace> space = serving.spaces.Get(served, policy);
  if (!space->WorkOut(tiles, stop)) return absl::CancelledError();
  if (cells && !space->WorkOutCells(tiles, stop)) return absl::CancelledError();
  return space;
}

// The tiles, of those named, that are not as in `sent`, or, if that is null, as a new one.
std::vector<uint64_t> Changed(const std::vector<uint64_t>& tiles, const ConfigurationSpace& space,
                              const ConfigurationSpace* sent, bool cells) {
  std::vector<uint64_t> changed;
  std::ranges::copy_if(tiles, std::back_inserter(changed), [&](uint64_t tile) {
    if (sent == nullptr) return space.tile(tile) != TileVerdicts();
    return space.tile(tile) != sent->tile(tile) ||
           (cells && space.free_cells(tile) != sent->free_cells(tile));
  });
  return changed;
}

}  // namespace

absl::StatusOr<bool> SpaceWatch::Prepare() {
  ASSIGN_OR_RETURN(
      const Served served,
      WithVariant(serving().scenes.Newest(serving().settings.clock()), request_.variant()));
  ASSIGN_OR_RETURN(const Policy policy, PolicyFor(serving(), request_.policy(), *served.database));
  ASSIGN_OR_RETURN(std::vector<uint64_t> tiles,
                   TilesFrom(request_.tiles(), served.database->grid()));
  ASSIGN_OR_RETURN(const bool obstacles, GivesObstacles(request_, *served.database, policy));
  // Who checks any configuration alone needs no map that is drawn.
  if (obstacles && request_.tiles().empty() && DrawsMaps(*served.database)) tiles.clear();
  RETURN_IF_ERROR(CheckWatched(*served.database, tiles.size()));
  const bool cells = TellsCells(request_.include_cells(), policy);
  ASSIGN_OR_RETURN(
      std::shared_ptr<const ConfigurationSpace> space,
      WorkedOut(serving(), served, policy, tiles, cells, [this] { return cancelled(); }));
  v1::WatchConfigurationSpaceResponse first;
  const Reason blocked = Conclude(serving(), served, policy, first.mutable_basis());
  if (serving().scenes.database() != served.whole) return Prepare();  // it was replaced
  const WatchedState state(served, blocked);
  if (state == told_of_) return false;
  if (state.database != told_of_.database || cells != cells_) {
    first.set_whole(true);
    ToMessage(served.database->grid(), serving().settings, first.mutable_grid());
    if (obstacles) ToMessage(*served.database, first.mutable_robot());
    sent_ = nullptr;
  }
  first.set_unknown_reason(ToMessage(blocked));
  first.set_skipped_scenes(ScenesSkipped(last_scene_, state.scene));
  changed_.clear();
  if (blocked == Reason::kNone && obstacles) AddPlanes(served, policy, &first);
  if (blocked == Reason::kNone && !tiles.empty()) {
    first.set_cells_exact(cells && space->cells_exact());
    changed_ = Changed(tiles, *space, sent_.get(), cells);
    sent_ = std::move(space);
  }
  told_of_ = state;
  cells_ = cells;
  last_scene_ = std::max(last_scene_, state.scene);
  first_ = std::move(first);
  next_ = 0;
  return true;
}

bool SpaceWatch::NextPart(v1::WatchConfigurationSpaceResponse& part) {
  if (next_ == 0) part = std::move(first_);
  const size_t end = std::min(changed_.size(), next_ + kTilesPerPart);
  for (; next_ < end; ++next_) {
    v1::ConfigurationSpaceTile& tile = *part.add_tiles();
    ToMessage(changed_[next_], sent_->tile(changed_[next_]), &tile);
    if (cells_) AddCells(changed_[next_], *sent_, &tile);
  }
  part.set_last_part(next_ == changed_.size());
  return !part.last_part();
}

void CheckStream::Start() {
  self_ = shared_from_this();
  StartRead(&bytes_);
  serving_.watches.Add(self_);
}

void CheckStream::Tell(uint64_t) {
  const std::lock_guard lock(mutex_);
  if (write_end_ && std::chrono::steady_clock::now() > *write_end_) context_->TryCancel();
}

void CheckStream::End() {
  const absl::Status status = absl::UnavailableError("the server stops; ask again when it is back");
  {
    const std::lock_guard lock(mutex_);
    if (step_ == Step::kAnswering) ending_ = status;
    if (step_ != Step::kReading) return;
    step_ = Step::kOver;
  }
  Finish(ToGrpc(status));
}

void CheckStream::OnReadDone(bool ok) {
  question_.Clear();
  absl::Status asked;
  if (ok) asked = serving_.clients.Call(client_);
  if (ok && (asked.ok() || bytes_.Length() <= kReadForItsId)) {
    const absl::Status read = ReadRequest(bytes_, question_);
    if (asked.ok()) asked = read;
  }
  // Of a question that could not be read the id is not known.
  using Question = v1::StreamChecksRequest;
  const bool over = !ok || (!asked.ok() && question_.question_case() == Question::QUESTION_NOT_SET);
  {
    const std::lock_guard lock(mutex_);
    if (step_ == Step::kOver) return;
    step_ = over ? Step::kOver : Step::kAnswering;
  }
  if (over) return Finish(ToGrpc(asked));  // OK: the caller asks no more
  if (!asked.ok()) return Work([&] { return asked; });
  const bool at_once =
      question_.has_configurations() && AnsweredAtOnce(serving_, question_.configurations());
  if (at_once) return Work([this] { return AnswerQuestion(); });
  const auto work = [self = self_] { self->Work([&] { return self->AnswerQuestion(); }); };
  if (!serving_.workers.Run(client_, bytes_.Length(), work)) {
    Work([this] { return serving_.clients.TooBusy(client_); });
  }
}

absl::Status CheckStream::AnswerQuestion() {
  const auto stop = [this] { return context_->IsCancelled(); };
  switch (question_.question_case()) {
    case v1::StreamChecksRequest::kConfigurations:
      return Answer(serving_, question_.configurations(), stop, answer_.mutable_configurations());
    case v1::StreamChecksRequest::kPath:
      return Answer(serving_, question_.path(), stop, answer_.mutable_path());
    case v1::StreamChecksRequest::QUESTION_NOT_SET:
      break;
  }
  return FieldError("question", "ask for configurations or for a path");
}

void CheckStream::Work(const std::function<absl::Status()>& answer) {
  answer_.Clear();
  answer_.set_id(question_.id());
  const absl::Status status = Guarded(answer);
  if (!status.ok()) {
    answer_.mutable_error()->set_code(status.raw_code());
    answer_.mutable_error()->set_message(std::string(status.message()));
  }
  WriteMessage(answer_, &bytes_);
  {
    const std::lock_guard lock(mutex_);
    write_end_ = std::chrono::steady_clock::now() +
                 absl::ToChronoNanoseconds(serving_.settings.longest_write);
  }
  StartWrite(&bytes_);
}

void CheckStream::OnWriteDone(bool ok) {
  std::unique_lock lock(mutex_);
  write_end_.reset();
  if (ok && !ending_) {
    step_ = Step::kReading;
    StartRead(&bytes_);
    return;
  }
  step_ = Step::kOver;
  lock.unlock();
  Finish(ok ? ToGrpc(*ending_) : grpc::Status::CANCELLED);  // not ok: the caller is gone
}

void CheckStream::OnDone() {
  place_.reset();
  const std::shared_ptr<Watcher> last = std::move(self_);  // perhaps a worker still holds it
}

}  // namespace silhouette
