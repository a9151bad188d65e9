// SPDX-License-Identifier: Apache-2.0
// SimpleMessageServer: a simulated controller behind ROS-Industrial's simple_message, as
// capture/drivers/robots/simple_message_link.h speaks to it.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/drivers/robots/simple_message.h"
#include "capture/drivers/robots/tcp_socket.h"
#include "capture/sim/served/simulated_controller.h"

namespace silhouette {

struct SimpleMessageServerSettings {
  std::string host = "127.0.0.1";
  int motion_port = 0;  // 0: a free one
  int state_port = 0;
  simple_message::ByteOrder byte_order = simple_message::ByteOrder::kLittle;
  // JOINT_FEEDBACK instead of JOINT_POSITION.
  bool joint_feedback = false;
  absl::Duration state_period = absl::Milliseconds(10);
};

// How the connection fails.
enum class ConnectionFault {
  kNone,
  kSilent,   // it stays, and no state comes
  kHalf,     // the state ends in the middle of a message
  kGarbage,  // the state is no simple_message
  kClosed,   // both connections are closed, once
  kDead,     // both carry nothing more, as if it was switched off and on; new ones work
};

class SimpleMessageServer {
 public:
  // `controller` must outlive it. Errors: ListenTcp's.
  static absl::StatusOr<std::unique_ptr<SimpleMessageServer>> Start(
      SimulatedController& controller, const SimpleMessageServerSettings& settings);
  ~SimpleMessageServer();

  int motion_port() const { return PortOf(motion_listener_); }
  int state_port() const { return PortOf(state_listener_); }

  // May be called while it serves.
  void SetFault(ConnectionFault fault) { fault_ = fault; }

 private:
  struct Client {
    FileDescriptor socket;
    simple_message::MessageReader reader;
    bool dead = false;  // nothing passes any more
  };

  SimpleMessageServer(SimulatedController& controller, SimpleMessageServerSettings settings,
                      FileDescriptor motion, FileDescriptor state);
  void Run();
  void Accept(const FileDescriptor& listener, std::vector<Client>& clients) const;
  void SendState();
  std::vector<uint8_t> StateBytes() const;
  // False: the client is gone.
  bool Serve(Client& client);
  // Whether a request is done or under way.
  bool Execute(const simple_message::Message& request);
  bool Execute(const simple_message::JointTrajPt& point);
  bool Execute(const simple_message::JointTrajPtFull& point);
  // The commanded joint values.
  std::vector<double> JointsIn(const simple_message::JointValues& positions) const;

  SimulatedController& controller_;
  const SimpleMessageServerSettings settings_;
  const FileDescriptor motion_listener_;
  const FileDescriptor state_listener_;
  std::atomic<ConnectionFault> fault_ = ConnectionFault::kNone;
  std::atomic<bool> ending_ = false;

  // Of the serving thread.
  std::vector<Client> motion_clients_;
  std::vector<Client> state_clients_;
  bool half_sent_ = false;
  bool full_begun_ = false;  // a trajectory of full points has its start

  std::thread thread_;
};

}  // namespace silhouette
