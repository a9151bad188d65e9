// SPDX-License-Identifier: Apache-2.0
// Who may call what.
#include "server/gate/roles.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include "silhouette/v1/collision_service.pb.h"
#include "silhouette/v1/database_service.pb.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const Roles kRoleNames({{Role::kPlanner, {"p", "both"}},
                        {Role::kPublisher, {"s"}},
                        {Role::kOperator, {"o", "both"}},
                        {Role::kAdministrator, {"a"}}});

bool May(const std::string& client, const std::string& call) {
  return kRoleNames.Permit(std::vector<std::string>{client}, "/silhouette.v1." + call).ok();
}

TEST(Roles, EveryCallOfEveryServiceHasOne) {
  for (const google::protobuf::FileDescriptor* file :
       {v1::CheckPathRequest::descriptor()->file(), v1::PublishSceneRequest::descriptor()->file(),
        v1::GetDatabaseRequest::descriptor()->file()}) {
    ASSERT_GT(file->service_count(), 0);
    for (int i = 0; i < file->service_count(); ++i) {
      for (int j = 0; j < file->service(i)->method_count(); ++j) {
        const std::string call =
            "/" + file->service(i)->full_name() + "/" + file->service(i)->method(j)->name();
        EXPECT_NE(AccessOf(call), Access::kNothing) << call;
        EXPECT_NE(AccessOf(call), Access::kCertificate) << call;
      }
    }
  }
}

TEST(Roles, EachMayDoItsOwnAndReadAndNoMore) {
  struct {
    const char* call;
    std::string who;
  } const calls[] = {{"CollisionService/CheckPath", "p"},
                     {"CollisionService/WatchPath", "p"},
                     {"CollisionService/Explain", "p"},
                     {"SceneService/PublishScene", "s"},
                     {"SceneService/AllowRegion", "o"},
                     {"SceneService/RevokeRegion", "o"},
                     {"SceneService/ChangeVariant", "o"},
                     {"SceneService/GetScene", "pso"},
                     {"SceneService/WatchScenes", "o"},
                     {"DatabaseService/GetDatabase", "pso"},
                     {"CollisionService/CheckConfigurations", "pso"}};
  for (const auto& [call, who] : calls) {
    for (const char client : {'p', 's', 'o'}) {
      EXPECT_EQ(May({client}, call), who.find(client) != std::string::npos) << client << call;
    }
    EXPECT_TRUE(May("a", call));
    EXPECT_FALSE(May("stranger", call));
    EXPECT_FALSE(May("", call));
  }
  EXPECT_TRUE(May("both", "CollisionService/CheckPath"));
  EXPECT_TRUE(May("both", "SceneService/AllowRegion"));
  EXPECT_FALSE(May("both", "SceneService/PublishScene"));
}

TEST(Roles, UnknownCallIsNobodysAndHealthIsOfAnyCertificate) {
  EXPECT_FALSE(May("a", "SceneService/SetEverything"));
  EXPECT_FALSE(May("a", ""));
  const std::string health = "/grpc.health.v1.Health/Check";
  EXPECT_TRUE(kRoleNames.Permit(std::vector<std::string>{"stranger"}, health).ok());
  EXPECT_FALSE(kRoleNames.Permit({}, health).ok());
  EXPECT_FALSE(
      Roles().Permit(std::vector<std::string>{"a"}, "/silhouette.v1.SceneService/GetScene").ok());
}

TEST(Roles, AnyNameOfACertificateCounts) {
  const std::string call = "/silhouette.v1.SceneService/PublishScene";
  EXPECT_TRUE(kRoleNames.Permit(std::vector<std::string>{"x", "s"}, call).ok());
}

TEST(Roles, DenialNamesClientCallRoleAndMend) {
  const absl::Status denied = kRoleNames.Permit(std::vector<std::string>{"p\n"},
                                                "/silhouette.v1.SceneService/PublishScene");
  EXPECT_TRUE(absl::IsPermissionDenied(denied));
  EXPECT_EQ(denied.message(),
            "'p\\n' may not call PublishScene, which needs the role publisher: it has no role; "
            "name it under 'server: roles' in the cell file");
  EXPECT_THAT(std::string(kRoleNames
                              .Permit(std::vector<std::string>{"both"},
                                      "/silhouette.v1.SceneService/PublishScene")
                              .message()),
              HasSubstr("it has the role planner, operator;"));
}

TEST(Roles, NamesAreBoundedAndNotEmpty) {
  EXPECT_THROW(Roles({{Role::kPlanner, {""}}}), std::invalid_argument);
  EXPECT_THROW(Roles({{Role::kPlanner, {std::string(257, 'a')}}}), std::invalid_argument);
  using Names = std::map<Role, std::vector<std::string>>;
  EXPECT_THROW(Roles(Names{{Role::kPlanner, {}}}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
