// SPDX-License-Identifier: Apache-2.0
#include "silhouette/messages.h"

#include "clients/python/bindings.h"

namespace silhouette::python {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

py::object MaskArray(const v1::Mask& message) {
  const Mask mask = client::FromMessage(message);
  py::array_t<bool> pixels({mask.height(), mask.width()});
  bool* out = pixels.mutable_data();
  for (size_t i = 0; i < mask.size().pixels(); ++i) {
    out[i] = (mask.words()[i / 64] >> (i % 64) & 1) != 0;
  }
  return pixels;
}

// Field `at` of the message; with `index` 0 or more, the index-th of a repeated field.
py::object ValueOf(const Message& message, const FieldDescriptor* at, int index) {
  const auto& reflection = *message.GetReflection();
  const bool one = index < 0;
#define SILHOUETTE_FIELD(Type) \
  (one ? reflection.Get##Type(message, at) : reflection.GetRepeated##Type(message, at, index))
  switch (at->cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return py::int_(SILHOUETTE_FIELD(Int32));
    case FieldDescriptor::CPPTYPE_INT64:
      return py::int_(SILHOUETTE_FIELD(Int64));
    case FieldDescriptor::CPPTYPE_UINT32:
      return py::int_(SILHOUETTE_FIELD(UInt32));
    case FieldDescriptor::CPPTYPE_UINT64:
      return py::int_(SILHOUETTE_FIELD(UInt64));
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return py::float_(SILHOUETTE_FIELD(Double));
    case FieldDescriptor::CPPTYPE_FLOAT:
      return py::float_(SILHOUETTE_FIELD(Float));
    case FieldDescriptor::CPPTYPE_BOOL:
      return py::bool_(SILHOUETTE_FIELD(Bool));
    case FieldDescriptor::CPPTYPE_ENUM: {
      const int number = SILHOUETTE_FIELD(EnumValue);
      const auto* value = at->enum_type()->FindValueByNumber(number);
      return value == nullptr ? py::object(py::int_(number)) : py::str(value->name());
    }
    case FieldDescriptor::CPPTYPE_STRING: {
      const std::string text = SILHOUETTE_FIELD(String);
      if (at->type() == FieldDescriptor::TYPE_BYTES) return py::bytes(text);
      return py::str(text);
    }
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return ToPython(SILHOUETTE_FIELD(Message));
  }
#undef SILHOUETTE_FIELD
  return py::none();
}

}  // namespace

py::object ToPython(const Message& message) {
  if (const auto* mask = dynamic_cast<const v1::Mask*>(&message)) return MaskArray(*mask);
  if (const auto* time = dynamic_cast<const google::protobuf::Timestamp*>(&message)) {
    return py::float_(static_cast<double>(time->seconds()) + time->nanos() * 1e-9);
  }
  if (const auto* duration = dynamic_cast<const google::protobuf::Duration*>(&message)) {
    return py::float_(static_cast<double>(duration->seconds()) + duration->nanos() * 1e-9);
  }
  const auto& reflection = *message.GetReflection();
  py::dict fields;
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor* at = message.GetDescriptor()->field(i);
    py::object value = py::none();
    if (at->is_repeated()) {
      py::list values;
      for (int j = 0; j < reflection.FieldSize(message, at); ++j) {
        values.append(ValueOf(message, at, j));
      }
      value = std::move(values);
    } else if (!at->has_presence() || reflection.HasField(message, at)) {
      value = ValueOf(message, at, -1);
    }
    fields[at->name().c_str()] = std::move(value);
  }
  return fields;
}

}  // namespace silhouette::python
