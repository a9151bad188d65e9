// SPDX-License-Identifier: Apache-2.0
// Variants over gRPC.
#include "tests/server/service/test_server.h"
#include "tests/server/tool_variant.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

std::shared_ptr<const ServedDatabase> VariantsServiceBothVariants(bool index = true) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db");
  AddTools(folder / "db");
  if (index) BuildIndex(folder / "db");
  return LoadDatabase(folder / "db");
}

// Where the tool alone touches a block: joint a at 1, the tool at 2.
const Configuration kVariantsServiceToolTouches = At(1, 1);
constexpr int kVariantsServiceBlock = 2;

v1::CheckConfigurationsResponse CheckWith(TestServer& server, const std::string& variant,
                                          bool by_number) {
  v1::CheckConfigurationsRequest request;
  request.set_variant(variant);
  if (by_number) {
    request.add_numbers(static_cast<uint32_t>(GridOf(ServerTestCell())->NumberOf({1, 1})));
  } else {
    Set(kVariantsServiceToolTouches, request.add_configurations());
  }
  v1::CheckConfigurationsResponse response;
  const grpc::Status status = server.Call(request, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response;
}

// As the calls that look configurations up in a map say it, and as the others do.
bool FreeWith(TestServer& server, const std::string& variant) {
  const auto one = CheckWith(server, variant, /*by_number=*/false);
  const auto by_number = CheckWith(server, variant, /*by_number=*/true);
  const std::string expected = variant.empty() ? one.basis().scene_variant() : variant;
  EXPECT_EQ(one.basis().variant(), expected);
  EXPECT_EQ(by_number.basis().variant(), expected);
  v1::CheckPathRequest path;
  path.set_variant(variant);
  Set(kVariantsServiceToolTouches, path.add_waypoints());
  v1::CheckPathResponse path_response;
  EXPECT_TRUE(server.Call(path, &path_response).ok());
  v1::ExplainRequest explain;
  explain.set_variant(variant);
  Set(kVariantsServiceToolTouches, explain.mutable_configuration());
  v1::ExplainResponse explained;
  EXPECT_TRUE(server.Call(explain, &explained).ok());
  v1::GetConfigurationSpaceRequest space;
  space.set_variant(variant);
  const auto parts = server.Space(space);
  EXPECT_EQ(parts[0].basis().variant(), expected);
  const auto number = GridOf(ServerTestCell())->NumberOf({1, 1});
  const bool in_space = (parts[0].tiles(0).free()[number / 8] >> (number % 8) & 1) != 0;

  const bool free = one.verdicts(0).state() == v1::Verdict::STATE_FREE;
  EXPECT_EQ(free, (by_number.free()[0] & 1) != 0);
  EXPECT_EQ(free, path_response.verdict().state() == v1::Verdict::STATE_FREE);
  EXPECT_EQ(free, explained.verdict().state() == v1::Verdict::STATE_FREE);
  EXPECT_EQ(free, in_space);
  return free;
}

// In whatever order variants are asked for: no map of one is taken for that of another.
TEST(VariantsService, EachRequestIsAnsweredWithItsVariant) {
  TestServer server(VariantsServiceBothVariants());
  for (int round = 0; round < 2; ++round) {
    const v1::Scene plain = server.Publish(SceneWithBlock(kVariantsServiceBlock));
    EXPECT_EQ(plain.variant(), "default");
    EXPECT_TRUE(FreeWith(server, ""));
    EXPECT_FALSE(FreeWith(server, kTool));
    EXPECT_TRUE(FreeWith(server, "default"));
    const v1::Scene tool = server.Publish(ToolScene(0, 0, kVariantsServiceBlock));
    EXPECT_EQ(tool.variant(), kTool);
    EXPECT_EQ(tool.defects_size(), 0);
    EXPECT_FALSE(FreeWith(server, ""));
    EXPECT_TRUE(FreeWith(server, "default"));
    EXPECT_FALSE(FreeWith(server, kTool));
  }
}

TEST(VariantsService, AVariantThatIsNotThereIsRefusedWithTheNamesOfThoseThatAre) {
  TestServer server(VariantsServiceBothVariants());
  server.Publish(EmptyCellScene());
  v1::CheckConfigurationsRequest request;
  request.set_variant("none");
  Set(At(1, 1), request.add_configurations());
  v1::CheckConfigurationsResponse response;
  const grpc::Status status = server.Call(request, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("its variants are default, tool"));
  v1::CheckPathRequest path;
  path.set_variant("none");
  Set(At(1, 1), path.add_waypoints());
  v1::CheckPathResponse path_response;
  EXPECT_EQ(server.Call(path, &path_response).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  v1::GetConfigurationSpaceRequest space;
  space.set_variant("none");
  std::vector<v1::GetConfigurationSpaceResponse> parts;
  EXPECT_EQ(server.Call(space, &parts).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST(VariantsService, ASceneOfAnUnknownVariantIsTakenAndNeverFree) {
  TestServer server(VariantsServiceBothVariants());
  SceneInput input = EmptyCellScene();
  input.variant = "none";
  const v1::Scene scene = server.Publish(input);
  ASSERT_GE(scene.defects_size(), 1);
  EXPECT_EQ(scene.defects(0).reason(), v1::Verdict::REASON_VARIANT_UNKNOWN);
  const v1::Verdict verdict = server.CheckOne(At(3, 3));
  EXPECT_EQ(verdict.state(), v1::Verdict::STATE_UNKNOWN);
  EXPECT_EQ(verdict.reason(), v1::Verdict::REASON_VARIANT_UNKNOWN);
  const auto parts = server.Space();
  EXPECT_EQ(parts[0].unknown_reason(), v1::Verdict::REASON_VARIANT_UNKNOWN);
  EXPECT_EQ(parts[0].tiles_size(), 0);
}

TEST(VariantsService, TheDatabaseTellsItsVariants) {
  TestServer server(VariantsServiceBothVariants(/*index=*/false));
  const v1::GetDatabaseResponse response = server.GetDatabase();
  ASSERT_EQ(response.variants_size(), 2);
  EXPECT_EQ(response.variants(0).name(), "default");
  EXPECT_EQ(response.variants(1).name(), kTool);
  EXPECT_EQ(response.variants(1).captured(), 40u);
}

// Who watches without naming a variant sees the map of the variant that the newest scene has.
TEST(VariantsService, AWatchFollowsTheVariantOfTheScene) {
  TestServer server(VariantsServiceBothVariants());
  server.Publish(SceneWithBlock(kVariantsServiceBlock));
  grpc::ClientContext context;
  const auto reader = server.collision->WatchConfigurationSpace(&context, {});
  v1::WatchConfigurationSpaceResponse update;
  const auto number = GridOf(ServerTestCell())->NumberOf({1, 1});
  const auto free = [&] {
    return update.tiles_size() > 0 && (update.tiles(0).free()[number / 8] >> (number % 8) & 1) != 0;
  };
  ASSERT_TRUE(reader->Read(&update));
  EXPECT_TRUE(update.whole());
  EXPECT_EQ(update.basis().variant(), "default");
  EXPECT_TRUE(free());
  const v1::Scene scene = server.Publish(ToolScene(0, 0, kVariantsServiceBlock));
  do {
    ASSERT_TRUE(reader->Read(&update));
  } while (update.basis().scene_id() != scene.id());
  EXPECT_TRUE(update.whole());
  EXPECT_EQ(update.basis().variant(), kTool);
  ASSERT_EQ(update.tiles_size(), 1);
  EXPECT_FALSE(free());
  context.TryCancel();
}

}  // namespace
}  // namespace silhouette
