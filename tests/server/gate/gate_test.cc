// SPDX-License-Identifier: Apache-2.0
// A server behind its gate: who gets in, what each may do, and what is recorded.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/bio.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <poll.h>
#include <pwd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "proto/tls/channel_credentials.h"
#include "server/audit/audit_log.h"
#include "server/gate/caller.h"
#include "server/gate/credentials.h"
#include "silhouette/client.h"
#include "silhouette/messages.h"
#include "tests/certificates.h"
#include "tests/folders.h"
#include "tests/server/service/raw_call.h"
#include "tests/server/service/test_server.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using client::ClientTls;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

const std::filesystem::path& Certificates() {
  static const std::filesystem::path folder = MakeCertificates();
  return folder;
}

void CopyCertificates(const std::filesystem::path& from, const std::filesystem::path& to) {
  for (const auto& file : std::filesystem::directory_iterator(from)) {
    std::filesystem::copy_file(file.path(), to / file.path().filename(),
                               std::filesystem::copy_options::overwrite_existing);
  }
}

ClientTls TlsOf(const std::string& role, const std::filesystem::path& folder = Certificates()) {
  return {.ca = folder / "ca.pem",
          .certificate = folder / (role + ".pem"),
          .key = folder / (role + ".key")};
}

GateSettings TlsGate(const std::filesystem::path& folder = Certificates()) {
  GateSettings gate;
  gate.tls = TlsFiles{.certificate = folder / "server.pem",
                      .key = folder / "server.key",
                      .client_ca = folder / "ca.pem"};
  gate.roles = Roles({{Role::kPlanner, {"planner"}},
                      {Role::kPublisher, {"publisher"}},
                      {Role::kOperator, {"operator"}},
                      {Role::kAdministrator, {"administrator"}}});
  return gate;
}

struct GateTest : testing::Test {
  void Start(const GateSettings& gate, const std::string& address = "127.0.0.1:0") {
    ServingSettings settings;
    settings.gate = gate;
    settings.audit = *AuditLog::Open(audit);
    auto started = Server::Start(address, NewDatabase(), settings);
    ASSERT_TRUE(started.ok()) << started.status();
    server = *std::move(started);
  }

  Client ClientOf(const ClientTls& tls) const {
    return Client::Connect(server->address(), absl::Seconds(5), tls).value();
  }
  absl::Status Ask(const ClientTls& tls) const { return ClientOf(tls).GetDatabase().status(); }

  // Waits for the audit file to be whole.
  std::string Audited() {
    server.reset();
    EXPECT_TRUE(ReadAudit(audit).ok()) << ReadAudit(audit).status();
    return ContentOf(audit);
  }

  const std::string audit = FreshFolder() / "audit.jsonl";
  std::unique_ptr<Server> server;
};

// Of this moment.
absl::Status PublishEmptyCell(const Client& client) {
  const auto taken = client::RunningClock::now();
  return client.PublishScene(RequestOf(EmptyCellScene()), taken).status();
}

// The kinds of calls that do not end with PermissionDenied.
std::set<std::string> AllowedFor(const Client& client) {
  const std::vector<Configuration> path = {At(0, 0), At(1, 0)};
  v1::AllowRegionRequest region;
  region.set_name("part");
  auto watch = client.WatchPath(path);
  const std::pair<std::string, absl::Status> ends[] = {
      {"check", client.CheckPath(path).status()},
      {"space", client.GetConfigurationSpace().status()},
      {"watch", watch.ok() ? watch->Next(absl::Seconds(5)).status() : watch.status()},
      {"explain", client.Explain(At(0, 0)).status()},
      {"publish", PublishEmptyCell(client)},
      {"allow", client.AllowRegion(region).status()},
      {"revoke", client.RevokeRegion("part").status()},
      {"variant", client.ChangeVariant("default").status()},
      {"read", client.GetDatabase().status()},
      {"read regions", client.ListAllowedRegions().status()}};
  std::set<std::string> allowed;
  for (const auto& [kind, status] : ends) {
    EXPECT_FALSE(absl::IsUnavailable(status)) << kind << ": " << status;
    if (!absl::IsPermissionDenied(status)) allowed.insert(kind);
  }
  return allowed;
}

TEST_F(GateTest, EachRoleMakesItsOwnCallsAndDeniedOnesAreRecorded) {
  Start(TlsGate());
  using Kinds = std::set<std::string>;
  const Kinds planner = {"check", "space", "watch", "explain", "read", "read regions"};
  const Kinds publisher = {"publish", "read", "read regions"};
  const Kinds operators = {"allow", "revoke", "variant", "read", "read regions"};
  EXPECT_EQ(AllowedFor(ClientOf(TlsOf("planner"))), planner);
  EXPECT_EQ(AllowedFor(ClientOf(TlsOf("publisher"))), publisher);
  EXPECT_EQ(AllowedFor(ClientOf(TlsOf("operator"))), operators);
  Kinds all = planner;
  all.insert(publisher.begin(), publisher.end());
  all.insert(operators.begin(), operators.end());
  EXPECT_EQ(AllowedFor(ClientOf(TlsOf("administrator"))), all);
  const std::string audited = Audited();
  const std::string publish =
      "\"call.denied\",\"detail\":\"/silhouette.v1.SceneService/PublishScene\"";
  EXPECT_THAT(audited,
              AllOf(HasSubstr("\"who\":\"'planner'\",\"what\":" + publish),
                    HasSubstr("\"who\":\"'operator'\",\"what\":" + publish),
                    Not(HasSubstr("\"who\":\"'administrator'\",\"what\":\"call.denied\""))));
}

std::string ThisUser() { return getpwuid(getuid())->pw_name; }

TEST_F(GateTest, UserAtTheOtherEndOfAUnixSocketHasItsRole) {
  GateSettings gate;
  gate.roles = Roles({{Role::kPlanner, {ThisUser()}}, {Role::kPublisher, {"nobody"}}});
  Start(gate, "unix:" + (FreshFolder() / "socket").string());
  EXPECT_THAT(AllowedFor(ClientOf({})),
              ElementsAre("check", "explain", "read", "read regions", "space", "watch"));
  EXPECT_THAT(Audited(), HasSubstr("\"who\":\"'" + ThisUser() + "'\",\"what\":\"call.denied\""));
}

TEST_F(GateTest, UserHasTheRolesOfAllItsNames) {
  const std::string number = "uid " + std::to_string(getuid());
  GateSettings gate;
  gate.roles = Roles({{Role::kPlanner, {ThisUser()}}, {Role::kPublisher, {number}}});
  Start(gate, "unix:" + (FreshFolder() / "socket").string());
  EXPECT_THAT(AllowedFor(ClientOf({})),
              ElementsAre("check", "explain", "publish", "read", "read regions", "space", "watch"));
}

TEST_F(GateTest, UserWithoutARoleMayDoNothing) {
  GateSettings gate;
  gate.roles = Roles({{Role::kAdministrator, {getuid() == 0 ? "nobody" : "root"}}});
  Start(gate, "unix:" + (FreshFolder() / "socket").string());
  EXPECT_THAT(AllowedFor(ClientOf({})), testing::IsEmpty());
  EXPECT_THAT(Ask({}).message(), HasSubstr("a user without a role"));
  EXPECT_THAT(Audited(), AllOf(HasSubstr("\"who\":\"uid " + std::to_string(getuid()) +
                                         "\",\"what\":\"connection.denied\""),
                               HasSubstr("\"who\":\"\",\"what\":\"call.denied\"")));
}

TEST_F(GateTest, RolesOfUsersThatThisMachineDoesNotHaveAreRefused) {
  ServingSettings settings;
  settings.gate.roles = Roles({{Role::kPlanner, {"uid 1234", "nobody-here"}}});
  const auto refused = Server::Start("unix:" + (FreshFolder() / "socket").string(), NewDatabase(),
                                     std::move(settings));
  EXPECT_THAT(refused.status().message(), HasSubstr("no user 'nobody-here'"));
}

TEST(UserAt, IsWhoConnectedNotWhoListens) {
  if (getuid() != 0) GTEST_SKIP() << "only root becomes another user";
  const std::filesystem::path path = FreshFolder() / "socket";
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  path.string().copy(name.sun_path, sizeof(name.sun_path) - 1);
  const int listener = socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(bind(listener, reinterpret_cast<const sockaddr*>(&name), sizeof(name)), 0);
  ASSERT_EQ(listen(listener, 2), 0);
  std::filesystem::permissions(path, std::filesystem::perms::all);
  std::filesystem::permissions(path.parent_path(), std::filesystem::perms::all);
  EXPECT_EQ(UserNamed("nobody").value(), 65534u);
  for (const uid_t uid : {uid_t{65534}, uid_t{61234}}) {
    const pid_t child = fork();
    if (child == 0) {
      const int connection = socket(AF_UNIX, SOCK_STREAM, 0);
      const bool connected =
          setresuid(uid, uid, uid) == 0 &&
          connect(connection, reinterpret_cast<const sockaddr*>(&name), sizeof(name)) == 0;
      if (!connected) _exit(1);
      pause();
    }
    pollfd ready{.fd = listener, .events = POLLIN, .revents = 0};
    ASSERT_EQ(poll(&ready, 1, 20'000), 1);
    const int accepted = accept(listener, nullptr, nullptr);
    EXPECT_EQ(UserAt(accepted), uid);
    close(accepted);
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
  }
  close(listener);
}

TEST_F(GateTest, NamedClientsBehindOneAddressAreCountedEachForItself) {
  ServingSettings settings;
  settings.gate = TlsGate();
  settings.limits.calls_per_second = 0.001;  // one call, and no other for a long time
  server = *Server::Start("127.0.0.1:0", NewDatabase(), std::move(settings));
  EXPECT_TRUE(Ask(TlsOf("planner")).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(Ask(TlsOf("planner")))) << "by another connection";
  EXPECT_TRUE(Ask(TlsOf("publisher")).ok());
}

TEST_F(GateTest, ChangesAreRecordedWithTheNameOfWhoMadeThem) {
  Start(TlsGate());
  const Client publisher = ClientOf(TlsOf("publisher"));
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(PublishEmptyCell(publisher).ok());
  }
  const Client on_duty = ClientOf(TlsOf("operator"));
  ASSERT_TRUE(on_duty.AllowRegion(RegionAt("part", 1, absl::Seconds(5), Block)).ok());
  ASSERT_TRUE(on_duty.RevokeRegion("part").ok());
  server->ReplaceDatabase(NewDatabase());
  for (int i = 0; i < 2; ++i) {
    CalibrationTrust moved;
    moved.message = "moved";
    server->SetTrust(std::make_shared<const CalibrationTrust>(moved));
  }
  std::vector<std::string> changes;
  for (const auto& line : absl::StrSplit(Audited(), '\n', absl::SkipEmpty())) {
    const auto json = nlohmann::json::parse(std::string(line));
    changes.push_back(json["what"].get<std::string>() + " by " +
                      json["who"].get<std::string>().substr(0, 10));
  }
  EXPECT_THAT(changes, ElementsAre("server.start by server", "scene.source by 'publisher",
                                   "region.allow by 'operator'", "region.revoke by 'operator'",
                                   "database.reload by server", "calibration.check by server",
                                   "server.stop by server"));
}

TEST_F(GateTest, HealthAndReflectionAreOpenToAnyCertificateOfTheAuthority) {
  GateSettings gate = TlsGate();
  gate.roles = Roles({{Role::kPlanner, {"other"}}});
  Start(gate);
  const ClientTls tls = TlsOf("planner");
  const auto channel = grpc::CreateChannel(
      server->address(),
      *ChannelCredentialsFor(server->address(), {tls.ca, tls.certificate, tls.key}));
  EXPECT_EQ(HealthOf(channel, ""), "\x08\x01");
  EXPECT_THAT(RawCall(channel, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
                      "\x3a\x01*"),
              HasSubstr("silhouette.v1.SceneService"));
  const absl::Status denied = Ask(tls);
  EXPECT_TRUE(absl::IsPermissionDenied(denied)) << denied;
  EXPECT_THAT(std::string(denied.message()),
              AllOf(HasSubstr("'planner' may not call GetDatabase, which needs a role"),
                    HasSubstr("it has no role")));
}

TEST_F(GateTest, WithoutAValidCertificateNobodyGetsIn) {
  Start(TlsGate());
  const std::filesystem::path others = MakeCertificates();
  std::filesystem::copy_file(Certificates() / "ca.pem", others / "ca.pem",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_TRUE(absl::IsUnavailable(Ask(TlsOf("administrator", others)))) << "of another authority";
  const std::filesystem::path expired = FreshFolder();
  CopyCertificates(Certificates(), expired);
  const std::string again = "SILHOUETTE_CERTIFICATE_DAYS=-1 " + SourceFolder() +
                            "/tools/certificates '" + expired.string() + "' 127.0.0.1 > /dev/null";
  ASSERT_EQ(std::system(again.c_str()), 0);
  EXPECT_TRUE(absl::IsUnavailable(Ask(TlsOf("administrator", expired)))) << "expired";
  EXPECT_TRUE(absl::IsUnavailable(Ask({}))) << "plain text";
  grpc::SslCredentialsOptions without{.pem_root_certs = ContentOf(Certificates() / "ca.pem"),
                                      .pem_private_key = "",
                                      .pem_cert_chain = ""};
  const auto channel = grpc::CreateChannel(server->address(), grpc::SslCredentials(without));
  grpc::ClientContext context;
  v1::GetDatabaseResponse response;
  const auto stub = v1::DatabaseService::NewStub(channel);
  EXPECT_EQ(stub->GetDatabase(&context, {}, &response).error_code(), grpc::StatusCode::UNAVAILABLE)
      << "no certificate";
  EXPECT_TRUE(Ask(TlsOf("planner")).ok());
}

TEST_F(GateTest, ClientRefusesAServerOfAnotherNameOrAuthority) {
  const std::filesystem::path elsewhere = MakeCertificates("cell.example");
  Start(TlsGate(elsewhere));
  const absl::Status status = Ask(TlsOf("planner", elsewhere));
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("wrong host"));
  server.reset();
  Start(TlsGate());
  EXPECT_TRUE(absl::IsUnavailable(Ask(TlsOf("planner", elsewhere))));
}

TEST_F(GateTest, ClientSaysWhatOfItsCertificatesDoesNotFitTheServer) {
  Start(TlsGate());
  EXPECT_THAT(std::string(Ask({}).message()), HasSubstr("give certificates if it has TLS"));
  ClientTls mixed = TlsOf("planner");
  mixed.key = TlsOf("publisher").key;
  const absl::Status other_key = Ask(mixed);
  EXPECT_TRUE(absl::IsUnavailable(other_key)) << other_key;
  EXPECT_THAT(std::string(other_key.message()), HasSubstr("is not that of the certificate"));
  server.reset();
  Start(GateSettings());
  const absl::Status plain = Ask(TlsOf("planner"));
  EXPECT_TRUE(absl::IsUnavailable(plain)) << plain;
  EXPECT_THAT(std::string(plain.message()), HasSubstr("does not encrypt"));
}

TEST_F(GateTest, RenewedCertificateIsUsedAndARunningWatchGoesOn) {
  const std::filesystem::path folder = FreshFolder();
  CopyCertificates(Certificates(), folder);
  Start(TlsGate(folder));
  const Client publisher = ClientOf(TlsOf("publisher"));
  ASSERT_TRUE(publisher.GetDatabase().ok());  // connects
  auto watch = ClientOf(TlsOf("planner")).WatchPath(std::vector<Configuration>{At(0, 0)});
  ASSERT_TRUE(watch->Next(absl::Seconds(5)).ok());

  // Of another authority: only who trusts the new one gets in.
  const std::filesystem::path renewed = MakeCertificates();
  CopyCertificates(renewed, folder);
  EXPECT_TRUE(Ask(TlsOf("planner", renewed)).ok());
  EXPECT_FALSE(ClientOf(TlsOf("operator")).GetDatabase().ok());
  ASSERT_TRUE(PublishEmptyCell(publisher).ok());
  const auto update = watch->Next(absl::Seconds(5));
  EXPECT_TRUE(update.ok()) << update.status();

  // Files that do not fit together leave those in use.
  std::filesystem::copy_file(folder / "planner.key", folder / "server.key",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_TRUE(ClientOf(TlsOf("publisher", renewed)).GetDatabase().ok());
  std::filesystem::remove(folder / "server.pem");
  EXPECT_TRUE(ClientOf(TlsOf("operator", renewed)).GetDatabase().ok());
}

// Makes the server's certificate of a folder valid from `from`.
void SetStart(const std::filesystem::path& folder, absl::Time from) {
  const auto read = [&](const char* name, auto* read_pem) {
    const std::string text = ContentOf(folder / name);
    const std::unique_ptr<BIO, decltype(&BIO_free)> bio(
        BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), BIO_free);
    return read_pem(bio.get(), nullptr, nullptr, nullptr);
  };
  const std::unique_ptr<X509, decltype(&X509_free)> certificate(
      read("server.pem", PEM_read_bio_X509), X509_free);
  const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> authority(
      read("ca.key", PEM_read_bio_PrivateKey), EVP_PKEY_free);
  ASN1_TIME_set(X509_getm_notBefore(certificate.get()), absl::ToTimeT(from));
  ASSERT_GT(X509_sign(certificate.get(), authority.get(), EVP_sha256()), 0);
  const std::unique_ptr<BIO, decltype(&BIO_free)> file(
      BIO_new_file((folder / "server.pem").c_str(), "w"), BIO_free);
  ASSERT_EQ(PEM_write_bio_X509(file.get(), certificate.get()), 1);
}

TEST_F(GateTest, RenewedCertificateThatIsNotValidYetIsUsedOnceItIs) {
  const std::filesystem::path folder = FreshFolder();
  CopyCertificates(Certificates(), folder);
  Start(TlsGate(folder));
  ASSERT_TRUE(Ask(TlsOf("planner")).ok());
  const std::filesystem::path renewed = MakeCertificates();
  SetStart(renewed, absl::Now() + absl::Hours(1));
  CopyCertificates(renewed, folder);
  EXPECT_THAT(std::string(ReadTls(*TlsGate(folder).tls).status().message()),
              HasSubstr("server.pem' is not valid before "));
  EXPECT_TRUE(Ask(TlsOf("publisher")).ok()) << "the former one is still in use";
  // It becomes valid, and its file's state stays as it is. The size varies with the signature.
  const std::filesystem::path file = folder / "server.pem";
  const auto written = std::filesystem::last_write_time(file);
  const auto size = std::filesystem::file_size(file);
  do {
    SetStart(folder, absl::Now() - absl::Hours(1));
  } while (std::filesystem::file_size(file) != size && !HasFatalFailure());
  std::filesystem::last_write_time(file, written);
  const absl::Status used = Ask(TlsOf("planner", renewed));
  EXPECT_TRUE(used.ok()) << used;
}

TEST_F(GateTest, FilesOfTlsAreCheckedAtTheStart) {
  const std::filesystem::path folder = FreshFolder();
  CopyCertificates(Certificates(), folder);
  const TlsFiles good = *TlsGate(folder).tls;
  EXPECT_TRUE(ReadTls(good).ok()) << ReadTls(good).status();
  const auto fault = [](const TlsFiles& files) {
    return std::string(ReadTls(files).status().message());
  };
  EXPECT_THAT(fault({good.certificate, folder / "planner.key", good.client_ca}),
              HasSubstr("planner.key' is not that of the certificate"));
  EXPECT_THAT(fault({good.key, good.key, good.client_ca}), HasSubstr("holds no certificate"));
  EXPECT_THAT(fault({good.certificate, good.certificate, good.client_ca}),
              HasSubstr("holds no private key"));
  EXPECT_THAT(fault({good.certificate, good.key, folder / "none"}), HasSubstr("cannot read"));
  const std::string again = "SILHOUETTE_CERTIFICATE_DAYS=-1 " + SourceFolder() +
                            "/tools/certificates '" + folder.string() + "' 127.0.0.1 > /dev/null";
  ASSERT_EQ(std::system(again.c_str()), 0);
  EXPECT_THAT(fault(good), HasSubstr("and not now; renew it"));
}

TEST_F(GateTest, SocketHasItsModeAndItsGroupFromTheFirstMoment) {
  const std::string path = FreshFolder() / "s";
  GateSettings gate;
  gate.socket_mode = 0620;
  gate.socket_group = "root";
  Start(gate, "unix:" + path);
  struct stat status {};
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0620u);
  EXPECT_TRUE(Ask({}).ok());
  ServingSettings nobodys;
  nobodys.gate.socket_group = "no-such-group";
  const auto refused =
      Server::Start("unix:" + (FreshFolder() / "s").string(), NewDatabase(), nobodys);
  EXPECT_THAT(std::string(refused.status().message()),
              HasSubstr("there is no group 'no-such-group'"));
}

TEST_F(GateTest, SocketWithAGroupAloneIsForTheGroup) {
  const std::string path = FreshFolder() / "s";
  GateSettings gate;
  gate.socket_group = "root";
  Start(gate, "unix:" + path);
  struct stat status {};
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0660u);
}

TEST(GateSettings, PlainTextStaysOnThisMachineUnlessAskedFor) {
  const auto fault = [](const std::string& address, const GateSettings& gate = {}) {
    return std::string(CheckGate(address, gate).message());
  };
  GateSettings insecure;
  insecure.insecure = true;
  for (const std::string address :
       {"127.0.0.1:1", "127.1.2.3:1", "[::1]:1", "localhost:1", "unix:/s"}) {
    EXPECT_EQ(fault(address), "");
  }
  for (const std::string address : {"0.0.0.0:1", "[::]:1", "192.0.2.7:1", "[::ffff:192.0.2.7]:1"}) {
    EXPECT_THAT(fault(address), HasSubstr("will not speak plain text on " + address));
    EXPECT_EQ(fault(address, insecure), "");
    EXPECT_EQ(fault(address, TlsGate()), "");
  }
  EXPECT_THAT(fault("unix:/s", TlsGate()), HasSubstr("is guarded by socket_mode"));
  GateSettings half = TlsGate();
  half.roles = {};
  EXPECT_THAT(fault("127.0.0.1:1", half), HasSubstr("tls needs 'roles'"));
  half = TlsGate();
  half.tls.reset();
  EXPECT_THAT(fault("127.0.0.1:1", half), HasSubstr("roles need 'tls'"));
  half = {};
  half.socket_mode = 0600;
  EXPECT_THAT(fault("127.0.0.1:1", half), HasSubstr("are for unix:path"));
}

}  // namespace
}  // namespace silhouette
