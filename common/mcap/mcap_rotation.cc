// SPDX-License-Identifier: Apache-2.0
#include "common/mcap/mcap_rotation.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr char kTimeInName[] = "%E4Y%m%dT%H%M%E3SZ";

// Whether a file has the name that NameOf() gives.
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

std::string McapRotation::NameOf(absl::Time begin) const {
  return absl::StrCat(settings_.folder, "/", settings_.prefix, "-",
                      absl::FormatTime(kTimeInName, begin, absl::UTCTimeZone()), ".mcap");
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
      (writer_->bytes() + waiting_bytes_ >= settings_.file_bytes || message.logged < newest_)) {
    status = Close();
  }
  if (writer_ == nullptr) {
    newest_ = message.logged;
    Begin(message.logged);
  }
  waiting_.push_back(message);
  waiting_bytes_ += message.data.size();
  newest_ = std::max(newest_, message.logged);
  if (waiting_bytes_ > kMostWaiting && !failed_) status.Update(Flush());
  while (waiting_bytes_ > kMostWaiting) LoseOldest();
  return status;
}

void McapRotation::Begin(absl::Time time) {
  writer_ = std::make_unique<McapWriter>(NameOf(time), channels_);
  std::vector<McapMessage> opening = opening_();
  for (McapMessage& message : opening) message.logged = time;
  opening_size_ = opening.size();
  waiting_.insert(waiting_.begin(), std::move_iterator(opening.begin()),
                  std::move_iterator(opening.end()));
}

void McapRotation::LoseOldest() {
  const auto begin = waiting_.begin() + static_cast<std::ptrdiff_t>(opening_size_);
  auto oldest = std::find_if(begin, waiting_.end(), [&](const McapMessage& message) {
    return std::ranges::count(settings_.standing, message.channel) == 0;
  });
  if (oldest == waiting_.end()) oldest = begin;
  waiting_bytes_ -= oldest->data.size();
  waiting_.erase(oldest);
  ++lost_;
}

absl::Status McapRotation::Flush() {
  absl::Status status;
  if (!waiting_.empty()) {
    std::error_code error;
    if (writer_->bytes() > 0 && !std::filesystem::exists(path_, error) && !error) {
      Begin(waiting_.front().logged);
    }
    const bool is_new = writer_->bytes() == 0;
    status = writer_->Write(waiting_);
    for (absl::Time named = waiting_.front().logged; absl::IsAlreadyExists(status);) {
      named += absl::Milliseconds(1);
      writer_->Rename(NameOf(named));
      status = writer_->Write(waiting_);
    }
    if (status.ok()) {
      waiting_.clear();
      opening_size_ = waiting_bytes_ = 0;
      path_ = writer_->path();
      if (is_new) MakeRoom();
    }
  }
  failed_ = !status.ok();
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
