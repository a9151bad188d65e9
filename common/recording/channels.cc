// SPDX-License-Identifier: Apache-2.0
#include "common/recording/channels.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/timestamp.pb.h>

#include <memory>
#include <set>

namespace silhouette {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptorProto;
using google::protobuf::FileDescriptor;

// The file after all that it imports.
void AddFile(const FileDescriptor& file, std::set<std::string>& added,
             google::protobuf::FileDescriptorSet& files) {
  if (!added.insert(file.name()).second) return;
  for (int i = 0; i < file.dependency_count(); ++i) AddFile(*file.dependency(i), added, files);
  file.CopyTo(files.add_file());
}

McapChannel ChannelOf(const std::string& topic, const Descriptor& type) {
  google::protobuf::FileDescriptorSet files;
  std::set<std::string> added;
  AddFile(*type.file(), added, files);
  return {.topic = topic,
          .message_encoding = "protobuf",
          .schema_name = type.full_name(),
          .schema_encoding = "protobuf",
          .schema = files.SerializeAsString()};
}

// Foxglove's schema, whose fields it knows by these names:
// https://docs.foxglove.dev/docs/sdk/schemas/compressed-image
const Descriptor& CompressedImageType() {
  static const Descriptor* const type = [] {
    google::protobuf::FileDescriptorProto file;
    file.set_name("foxglove/CompressedImage.proto");
    file.set_package("foxglove");
    file.set_syntax("proto3");
    file.add_dependency(google::protobuf::Timestamp::descriptor()->file()->name());
    google::protobuf::DescriptorProto& message = *file.add_message_type();
    message.set_name("CompressedImage");
    const auto add = [&](const std::string& name, int number, FieldDescriptorProto::Type of) {
      FieldDescriptorProto& field = *message.add_field();
      field.set_name(name);
      field.set_number(number);
      field.set_type(of);
      field.set_label(FieldDescriptorProto::LABEL_OPTIONAL);
      return &field;
    };
    add("timestamp", 1, FieldDescriptorProto::TYPE_MESSAGE)
        ->set_type_name(".google.protobuf.Timestamp");
    add("data", 2, FieldDescriptorProto::TYPE_BYTES);
    add("format", 3, FieldDescriptorProto::TYPE_STRING);
    add("frame_id", 4, FieldDescriptorProto::TYPE_STRING);
    // It lives as long as the program.
    auto* pool =
        new google::protobuf::DescriptorPool(google::protobuf::DescriptorPool::generated_pool());
    return pool->BuildFile(file)->message_type(0);
  }();
  return *type;
}

}  // namespace

std::vector<McapChannel> ChannelsOf(const v1::GetDatabaseResponse& database) {
  std::vector<McapChannel> channels = {
      ChannelOf("/database", *v1::GetDatabaseResponse::descriptor()),
      ChannelOf("/state", *v1::ServedState::descriptor()),
      ChannelOf("/scene", *v1::Scene::descriptor()),
      ChannelOf("/path", *v1::WatchedPath::descriptor())};
  for (const v1::View& view : database.views()) {
    channels.push_back(ChannelOf("/camera/" + view.name(), CompressedImageType()));
  }
  return channels;
}

std::string CompressedImageOf(const std::string& jpeg, absl::Time taken) {
  google::protobuf::DynamicMessageFactory factory;
  const Descriptor& type = CompressedImageType();
  const std::unique_ptr<google::protobuf::Message> message(factory.GetPrototype(&type)->New());
  const google::protobuf::Reflection& fields = *message->GetReflection();
  google::protobuf::Message& time =
      *fields.MutableMessage(message.get(), type.FindFieldByName("timestamp"));
  const int64_t nanoseconds = absl::ToUnixNanos(taken);
  time.GetReflection()->SetInt64(&time, time.GetDescriptor()->FindFieldByName("seconds"),
                                 nanoseconds / 1'000'000'000);
  time.GetReflection()->SetInt32(&time, time.GetDescriptor()->FindFieldByName("nanos"),
                                 static_cast<int32_t>(nanoseconds % 1'000'000'000));
  fields.SetString(message.get(), type.FindFieldByName("data"), jpeg);
  fields.SetString(message.get(), type.FindFieldByName("format"), "jpeg");
  return message->SerializeAsString();
}

absl::StatusOr<std::string> JpegOfCompressedImage(const std::string& serialized) {
  google::protobuf::DynamicMessageFactory factory;
  const Descriptor& type = CompressedImageType();
  const std::unique_ptr<google::protobuf::Message> message(factory.GetPrototype(&type)->New());
  if (!message->ParseFromString(serialized)) {
    return absl::DataLossError("a camera image of the recording cannot be parsed");
  }
  return message->GetReflection()->GetString(*message, type.FindFieldByName("data"));
}

}  // namespace silhouette
