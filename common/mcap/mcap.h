// SPDX-License-Identifier: Apache-2.0
// MCAP: a file of messages with their times and schemas, that other tools open, too. The format:
// https://mcap.dev/spec
#pragma once

#include <cstdint>
#include <string>

#include "absl/time/time.h"

namespace silhouette {

// Where the messages of one kind go.
struct McapChannel {
  std::string topic;             // "/scene"
  std::string message_encoding;  // "protobuf"
  // What the messages are: the name of their type, and its description in this encoding. Channels
  // with the same name have the same schema.
  std::string schema_name;
  std::string schema_encoding;
  std::string schema;

  bool operator==(const McapChannel&) const = default;
};

struct McapMessage {
  uint16_t channel = 0;  // its place among the file's channels
  // When it was recorded, and when what it speaks of happened: not before 1970.
  absl::Time logged;
  absl::Time published;
  std::string data;
};

}  // namespace silhouette
