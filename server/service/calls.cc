// SPDX-License-Identifier: Apache-2.0
#include "server/service/calls.h"

#include <google/protobuf/any.pb.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/wire_format_lite.h>
#include <grpcpp/support/proto_buffer_reader.h>
#include <grpcpp/support/proto_buffer_writer.h>
#include <spdlog/spdlog.h>

#include <exception>
#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "server/gate/caller.h"
#include "server/service/clients.h"

namespace silhouette {

namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

constexpr char kBadRequest[] = "type.googleapis.com/google.rpc.BadRequest";

// A field of bytes in Protobuf's wire format. The messages of google.rpc have hardly any others,
// and no package of Debian has them for C++.
void AddField(int number, const std::string& bytes, std::string* to) {
  google::protobuf::io::StringOutputStream stream(to);
  google::protobuf::io::CodedOutputStream out(&stream);
  google::protobuf::internal::WireFormatLite::WriteString(number, bytes, &out);
}

// google.rpc.Status.
std::string DetailsOf(const absl::Status& status) {
  std::string details;
  status.ForEachPayload([&](absl::string_view url, const absl::Cord& payload) {
    google::protobuf::Any any;
    any.set_type_url(std::string(url));
    any.set_value(std::string(payload));
    AddField(3, any.SerializeAsString(), &details);
  });
  if (details.empty()) return details;
  std::string whole;
  {
    google::protobuf::io::StringOutputStream stream(&whole);
    google::protobuf::io::CodedOutputStream out(&stream);
    google::protobuf::internal::WireFormatLite::WriteInt32(1, status.raw_code(), &out);
  }
  AddField(2, std::string(status.message()), &whole);
  return whole + details;
}

// The fields of messages of a type that are texts or messages with such; none for most types, so
// that a long path is not walked through.
const std::vector<const FieldDescriptor*>& FieldsWithTexts(
    const google::protobuf::Descriptor* type) {
  static std::mutex mutex;
  static std::map<const google::protobuf::Descriptor*, std::vector<const FieldDescriptor*>> known;
  {
    const std::lock_guard lock(mutex);
    if (const auto found = known.find(type); found != known.end()) return found->second;
  }
  std::vector<const FieldDescriptor*> fields;
  for (int i = 0; i < type->field_count(); ++i) {
    const FieldDescriptor* field = type->field(i);
    const bool message = field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    if (field->type() == FieldDescriptor::TYPE_STRING ||
        (message && !FieldsWithTexts(field->message_type()).empty())) {
      fields.push_back(field);
    }
  }
  const std::lock_guard lock(mutex);
  return known.emplace(type, std::move(fields)).first->second;
}

// `path`: of the message in the request, with a dot at its end; empty for the request itself.
absl::Status CheckTexts(const Message& message, const std::string& path) {
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  for (const FieldDescriptor* field : FieldsWithTexts(message.GetDescriptor())) {
    const bool repeated = field->is_repeated();
    const int count = repeated                              ? reflection.FieldSize(message, field)
                      : reflection.HasField(message, field) ? 1
                                                            : 0;
    for (int i = 0; i < count; ++i) {
      const auto name = [&] {
        return absl::StrCat(path, field->name(), repeated ? absl::StrCat("[", i, "]") : "");
      };
      if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
        RETURN_IF_ERROR(CheckTexts(repeated ? reflection.GetRepeatedMessage(message, field, i)
                                            : reflection.GetMessage(message, field),
                                   name() + "."));
        continue;
      }
      std::string scratch;
      const std::string& text =
          repeated ? reflection.GetRepeatedStringReference(message, field, i, &scratch)
                   : reflection.GetStringReference(message, field, &scratch);
      if (text.size() <= kLongestText) continue;
      return FieldError(name(), absl::StrCat("the text has ", text.size(), " bytes; at most ",
                                             kLongestText, " are taken"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status FieldError(const std::string& field, const std::string& message) {
  absl::Status status = absl::InvalidArgumentError(absl::StrCat(field, ": ", message));
  // Without the name that stands behind an index for people: "views[0] 'left'.scene_mask".
  std::string path = field;
  if (const size_t quote = path.find(" '"); quote != std::string::npos) {
    path.erase(quote, path.rfind('\'') + 1 - quote);
  }
  std::string violation;
  AddField(1, path, &violation);
  AddField(2, message, &violation);
  std::string bad_request;
  AddField(1, violation, &bad_request);
  status.SetPayload(kBadRequest, absl::Cord(bad_request));
  return status;
}

absl::Status ReadRequest(const grpc::ByteBuffer& bytes, size_t most, Message& request) {
  const std::string& type = request.GetDescriptor()->name();
  if (bytes.Length() > most) {
    return absl::ResourceExhaustedError(absl::StrCat(type, ": the message has ", bytes.Length(),
                                                     " bytes; at most ", most, " are taken"));
  }
  grpc::ByteBuffer copy(bytes);  // of references
  grpc::ProtoBufferReader reader(&copy);
  if (!request.ParseFromZeroCopyStream(&reader)) {
    request.Clear();
    return absl::InvalidArgumentError(
        absl::StrCat(type,
                     ": the message cannot be parsed; send what silhouette/v1 defines, with "
                     "texts in UTF-8"));
  }
  return CheckTexts(request, "");
}

void WriteMessage(const Message& message, grpc::ByteBuffer* bytes) {
  bytes->Clear();
  grpc::ProtoBufferWriter writer(bytes, grpc::kProtoBufferWriterMaxBufferLength,
                                 static_cast<int>(message.ByteSizeLong()));
  message.SerializeToZeroCopyStream(&writer);
}

std::string ClientOf(grpc::CallbackServerContext& context) {
  const std::string name = QuotedNameOf(context);
  return name.empty() ? ClientOf(context.peer()) : name;
}

absl::Status Guarded(const std::function<absl::Status()>& work) {
  try {
    return work();
  } catch (const std::exception& error) {
    spdlog::error("internal error: {}", error.what());
    return absl::InternalError("internal error of the server; its log says more");
  }
}

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), std::string(status.message()),
                      DetailsOf(status));
}

grpc::ServerUnaryReactor* AnswerHere(Serving& serving, grpc::CallbackServerContext* context,
                                     const std::function<absl::Status()>& work) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const absl::Status admitted = serving.clients.Call(ClientOf(*context));
  reactor->Finish(ToGrpc(admitted.ok() ? Guarded(work) : admitted));
  return reactor;
}

grpc::ServerUnaryReactor* AnswerOn(WorkerPool& workers, Serving& serving,
                                   grpc::CallbackServerContext* context,
                                   const grpc::ByteBuffer& request,
                                   std::function<absl::Status()> work) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const std::string client = ClientOf(*context);
  absl::Status admitted = serving.clients.Call(client);
  if (admitted.ok() && !workers.Run(client, request.Length(), [=, work = std::move(work)] {
        reactor->Finish(ToGrpc(context->IsCancelled() ? absl::CancelledError() : Guarded(work)));
      })) {
    admitted = serving.clients.TooBusy(client);
  }
  if (!admitted.ok()) reactor->Finish(ToGrpc(admitted));
  return reactor;
}

absl::StatusOr<Clients::Place> AdmitStream(Serving& serving, grpc::CallbackServerContext& context) {
  const std::string client = ClientOf(context);
  RETURN_IF_ERROR(serving.clients.Call(client));
  return serving.clients.Stream(client);
}

}  // namespace silhouette
