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
  for (McapMessage& message : opening_()) {
    message.logged = time;
    writer_->Add(message);
  }
  MakeRoom();
  return absl::OkStatus();
}

void McapRotation::MakeRoom() const {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(settings_.folder, error)) {
    if (IsNamedAfterTime(entry.path().filename().string(), settings_.prefix)) {
      files.push_back(entry.path());
    }
  }
  std::ranges::sort(files);  // their names begin with their times
  for (size_t i = 0; i + static_cast<size_t>(settings_.files) < files.size(); ++i) {
    if (files[i] != path_) std::filesystem::remove(files[i], error);
  }
}

absl::Status McapRotation::Add(const McapMessage& message) {
  absl::Status status;
  if (writer_ != nullptr && writer_->bytes() >= settings_.file_bytes && !failed_) status = Close();
  if (writer_ == nullptr) status = Begin(message.logged);
  if (waiting_ > kMostWaiting && !failed_) status.Update(Flush());
  if (writer_ == nullptr || waiting_ > kMostWaiting) {
    ++lost_;
    return status;
  }
  writer_->Add(message);
  waiting_ += message.data.size();
  return status;
}

absl::Status McapRotation::Flush() {
  if (writer_ == nullptr) return absl::OkStatus();
  const absl::Status status = writer_->Flush();
  failed_ = !status.ok();
  if (status.ok()) waiting_ = 0;
  return status;
}

absl::Status McapRotation::Close() {
  if (writer_ == nullptr) return absl::OkStatus();
  const absl::Status status = writer_->Close();
  failed_ = !status.ok();
  RETURN_IF_ERROR(status);
  waiting_ = 0;
  writer_.reset();
  return absl::OkStatus();
}

absl::Status EventExcerpts::Add(const McapMessage& message) {
  absl::Status status;
  if (until_ && message.logged > *until_) {
    until_.reset();
    status = files_.Close();
  }
  if (until_) {
    if (message.channel == standing_channel_) standing_ = message;
    return files_.Add(message);
  }
  kept_bytes_ += message.data.size();
  kept_.push_back(message);
  while (kept_.front().logged < message.logged - before_ || kept_bytes_ > kMostBytes) {
    kept_bytes_ -= kept_.front().data.size();
    if (kept_.front().channel == standing_channel_) standing_ = std::move(kept_.front());
    kept_.pop_front();
    if (kept_.empty()) break;
  }
  return status;
}

absl::Status EventExcerpts::Keep(absl::Time time) {
  until_ = time + after_;
  absl::Status first_error;
  if (standing_ && !kept_.empty()) {
    standing_->logged = kept_.front().logged;
    first_error.Update(files_.Add(*standing_));
  }
  for (McapMessage& message : kept_) {
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
