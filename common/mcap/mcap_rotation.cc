// SPDX-License-Identifier: Apache-2.0
#include "common/mcap/mcap_rotation.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr char kTimeInName[] = "%E4Y%m%dT%H%M%E3SZ";

// Whether a file has the name that Begin() gives.
bool IsNamedAfterTime(absl::string_view name, const std::string& prefix) {
  absl::Time time;
  std::string error;
  return absl::ConsumePrefix(&name, absl::StrCat(prefix, "-")) &&
         absl::ConsumeSuffix(&name, ".mcap") && absl::ParseTime(kTimeInName, name, &time, &error);
}

}  // namespace

McapRotation::McapRotation(McapRotationSettings settings, std::vector<McapChannel> channels,
                           std::function<std::vector<McapMessage>()> opening)
    : settings_(std::move(settings)), channels_(std::move(channels)), opening_(std::move(opening)) {
  if (settings_.file_bytes == 0 || settings_.files < 1) {
    throw std::invalid_argument("a file has at least one byte, and there is at least one file");
  }
}

absl::Status McapRotation::Begin(absl::Time time) {
  path_.clear();
  absl::StatusOr<std::unique_ptr<McapWriter>> writer = absl::AlreadyExistsError("");
  for (absl::Time named = time; absl::IsAlreadyExists(writer.status());
       named += absl::Milliseconds(1)) {
    writer = McapWriter::Create(
        absl::StrCat(settings_.folder, "/", settings_.prefix, "-",
                     absl::FormatTime(kTimeInName, named, absl::UTCTimeZone()), ".mcap"),
        channels_);
  }
  RETURN_IF_ERROR(writer.status());
  writer_ = *std::move(writer);
  path_ = writer_->path();
  newest_ = time;
  for (McapMessage& message : opening_()) {
    message.logged = time;
    writer_->Add(message);
  }
  MakeRoom();
  return absl::OkStatus();
}

void McapRotation::MakeRoom() {
  begun_.push_back(path_);
  if (begun_.size() > static_cast<size_t>(settings_.files)) begun_.erase(begun_.begin());
  std::vector<std::string> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(settings_.folder, error)) {
    if (IsNamedAfterTime(entry.path().filename().string(), settings_.prefix)) {
      files.push_back(entry.path().string());
    }
  }
  // Those of earlier runs first, by their names, which begin with their times.
  std::ranges::sort(files, {}, [&](const std::string& file) {
    const auto begun = std::ranges::find(begun_, file);
    return std::pair(begun == begun_.end() ? -1 : begun - begun_.begin(), file);
  });
  for (size_t i = 0; i + static_cast<size_t>(settings_.files) < files.size(); ++i) {
    std::filesystem::remove(files[i], error);
  }
}

absl::Status McapRotation::Add(const McapMessage& message) {
  absl::Status status;
  if (writer_ != nullptr && !failed_ &&
      (writer_->bytes() >= settings_.file_bytes || message.logged < newest_)) {
    status = Close();
  }
  if (writer_ == nullptr) status = Begin(message.logged);
  if (waiting_ > kMostWaiting && !failed_) status.Update(Flush());
  if (writer_ == nullptr || waiting_ > kMostWaiting) {
    ++lost_;
    return status;
  }
  writer_->Add(message);
  newest_ = std::max(newest_, message.logged);
  waiting_ += message.data.size();
  ++unwritten_;
  return status;
}

absl::Status McapRotation::Flush() {
  if (writer_ == nullptr) return absl::OkStatus();
  const absl::Status status = writer_->Flush();
  failed_ = !status.ok();
  if (status.ok()) waiting_ = unwritten_ = 0;
  return status;
}

absl::Status McapRotation::Close() {
  if (writer_ == nullptr) return absl::OkStatus();
  RETURN_IF_ERROR(Flush());
  const absl::Status status = writer_->Close();
  failed_ = !status.ok();
  RETURN_IF_ERROR(status);
  writer_.reset();
  return absl::OkStatus();
}

absl::Status EventExcerpts::Add(const McapMessage& message, absl::Duration running) {
  absl::Status status;
  if (until_ && running > *until_) {
    until_.reset();
    status = files_.Close();
  }
  if (until_) {
    if (message.channel == standing_channel_) standing_ = message;
    return files_.Add(message);
  }
  kept_bytes_ += message.data.size();
  kept_.push_back({message, running});
  while (kept_.front().running < running - before_ || kept_bytes_ > kMostBytes) {
    McapMessage& oldest = kept_.front().message;
    kept_bytes_ -= oldest.data.size();
    if (oldest.channel == standing_channel_) standing_ = std::move(oldest);
    kept_.pop_front();
    if (kept_.empty()) break;
  }
  return status;
}

absl::Status EventExcerpts::Keep(absl::Duration running) {
  until_ = running + after_;
  absl::Status first_error;
  if (standing_ && !kept_.empty()) {
    standing_->logged = kept_.front().message.logged;
    first_error.Update(files_.Add(*standing_));
  }
  for (auto& [message, when] : kept_) {
    first_error.Update(files_.Add(message));
    if (message.channel == standing_channel_) standing_ = std::move(message);
  }
  kept_.clear();
  kept_bytes_ = 0;
  return first_error;
}

absl::Status EventExcerpts::Close() {
  until_.reset();
  standing_.reset();
  kept_.clear();
  kept_bytes_ = 0;
  return files_.Close();
}

}  // namespace silhouette
