// SPDX-License-Identifier: Apache-2.0
#include "tools/program/program.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/test_folder.h"
#include "tools/program/progress.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

template <typename Run>
int RunTester(std::vector<std::string> arguments, const Run& run) {
  CLI::App app("A test", "tester");
  arguments.insert(arguments.begin(), "tester");
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  return RunProgram(app, static_cast<int>(argv.size()), argv.data(), run);
}

TEST(Program, MistakesOfTheUserAndFailuresOfTheWorldHaveTheirOwnExitCodes) {
  EXPECT_EQ(ExitCodeOf(absl::OkStatus()), 0);
  EXPECT_EQ(ExitCodeOf(absl::InvalidArgumentError("")), 2);
  EXPECT_EQ(ExitCodeOf(absl::NotFoundError("")), 2);
  EXPECT_EQ(ExitCodeOf(absl::FailedPreconditionError("")), 2);
  EXPECT_EQ(ExitCodeOf(absl::ResourceExhaustedError("")), 3);
  EXPECT_EQ(ExitCodeOf(absl::UnavailableError("")), 3);
  EXPECT_EQ(ExitCodeOf(absl::DataLossError("")), 3);
}

TEST(ProgramDeathTest, FileThatIsCutUnderItsMapEndsTheProgramWithOneSentence) {
  const std::filesystem::path file = FreshFolder() / "mapped";
  std::ofstream(file) << std::string(3 * 4096, 'x');
  const auto read_what_is_cut = [&] {
    const int descriptor = open(file.c_str(), O_RDONLY);
    const auto* map =
        static_cast<const char*>(mmap(nullptr, 3 * 4096, PROT_READ, MAP_SHARED, descriptor, 0));
    std::filesystem::resize_file(file, 100);
    return static_cast<int>(*const_cast<const volatile char*>(map + 2 * 4096));
  };
  EXPECT_EXIT(RunTester({}, read_what_is_cut), testing::ExitedWithCode(kWorldFailed),
              "^tester: a mapped file was cut while it was in use[^\n]*start again\n$");
}

TEST(Program, WrongCommandLineIsOneSentenceAndTheUsersMistake) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(RunTester({"--wrong"}, [] { return 0; }), 2);
  const std::string message = testing::internal::GetCapturedStderr();
  EXPECT_THAT(message, HasSubstr("tester: "));
  EXPECT_THAT(message, HasSubstr("--wrong"));
}

TEST(Program, UnknownOptionIsNamedBeforeWhereItsValueDoesNotFit) {
  CLI::App app("A test", "tester");
  int number = 0;
  app.add_option("number", number);
  std::vector<std::string> words = {"tester", "--out", "shown"};
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  testing::internal::CaptureStderr();
  EXPECT_EQ(RunProgram(app, 3, argv.data(), std::function<int()>([] { return 0; })), 2);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "tester: there is no option '--out'; see --help\n");
}

TEST(Program, MistypedSubcommandIsNamedWithTheNearest) {
  CLI::App app("A test", "tester");
  app.require_subcommand(1);
  CLI::App* scene = app.add_subcommand("scene")->require_subcommand(1);
  scene->add_subcommand("publish");
  app.add_subcommand("check");
  const auto message_of = [&](std::vector<std::string> words) {
    words.insert(words.begin(), "tester");
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    testing::internal::CaptureStderr();
    EXPECT_EQ(RunProgram(app, static_cast<int>(argv.size()), argv.data(),
                         std::function<int()>([] { return 0; })),
              2);
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_EQ(message_of({"chek", "--at", "1"}),
            "tester: there is no subcommand 'chek'; did you mean 'check'?\n");
  EXPECT_EQ(message_of({"scene", "publsh"}),
            "tester: there is no subcommand 'publsh'; did you mean 'publish'?\n");
  EXPECT_EQ(message_of({"weather"}),
            "tester: there is no subcommand 'weather'; known are 'scene' and 'check'\n");
  EXPECT_THAT(message_of({}), HasSubstr("A subcommand is required"));
}

TEST(Program, SubcommandIsNamedWhereOptionsOfTheProgramMayFollow) {
  CLI::App app("A test", "tester");
  app.require_subcommand(1)->fallthrough();
  CLI::App* scene = app.add_subcommand("scene")->require_subcommand(1)->fallthrough();
  scene->add_subcommand("publish");
  scene->add_subcommand("show");
  scene->add_option_group("choice");  // it has no name
  std::vector<std::string> words = {"tester", "scene", "bogus"};
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  testing::internal::CaptureStderr();
  EXPECT_EQ(RunProgram(app, 3, argv.data(), std::function<int()>([] { return 0; })), 2);
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("there is no subcommand 'bogus'; known are 'publish' and 'show'\n"));
}

TEST(Program, NumbersAreDecimalAndFiniteAndSizesHaveTheirUnit) {
  struct {
    int whole = 0;
    uint64_t number = 0;
    double real = 0;
    uint64_t bytes = 0;
  } got;
  const auto error_of = [&got](std::vector<std::string> words) {
    CLI::App app("A test", "tester");
    app.add_option("--whole", got.whole);
    app.add_option("--number", got.number);
    app.add_option("--real", got.real)->check(NumberFromZero());
    app.add_option("--bytes", got.bytes)->check(PositiveNumber())->transform(ByteSize());
    words.insert(words.begin(), "tester");
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    testing::internal::CaptureStderr();
    const int code = RunProgram(app, static_cast<int>(argv.size()), argv.data(),
                                std::function<int()>([] { return 0; }));
    const std::string error = testing::internal::GetCapturedStderr();
    EXPECT_EQ(code, error.empty() ? 0 : 2);
    return error;
  };
  EXPECT_EQ(error_of({"--whole", "-010", "--number", "08", "--real", "1e-3", "--bytes", "8kB"}),
            "");
  EXPECT_EQ(got.whole, -10);
  EXPECT_EQ(got.number, 8);
  EXPECT_EQ(got.real, 0.001);
  EXPECT_EQ(got.bytes, 8000);
  EXPECT_EQ(error_of({"--whole", "0x10"}),
            "tester: --whole: '0x10' is not a whole number; see --help\n");
  EXPECT_THAT(error_of({"--whole", "1.5"}), HasSubstr("'1.5' is not a whole number"));
  EXPECT_THAT(error_of({"--number", "-1"}), HasSubstr("--number: '-1' is less than 0"));
  for (const std::string wrong : {"inf", "nan", "0x10", "1e999", "x", ""}) {
    EXPECT_THAT(error_of({"--real", wrong}), HasSubstr("'" + wrong + "' is not a number;"));
  }
  EXPECT_THAT(error_of({"--real", "-1"}), HasSubstr("--real: '-1' is less than 0"));
  for (const std::string wrong : {"8", "8XB", "-8GB", "GB"}) {
    EXPECT_THAT(error_of({"--bytes", wrong}),
                HasSubstr("--bytes: '" + wrong + "' is no size with its unit; 8GB is"));
  }
  EXPECT_THAT(error_of({"--bytes", "0B"}), HasSubstr("is not a number above zero"));
}

TEST(Program, NumbersAboveZeroAreTold) {
  CLI::App app("", "tester");
  double size = 0;
  app.add_option("--size", size)->check(PositiveNumber());
  for (const std::string wrong : {"20mm", "0", "-1", "nan"}) {
    const std::vector<std::string> words = {"tester", "--size", wrong};
    std::vector<const char*> argv;
    for (const std::string& word : words) argv.push_back(word.c_str());
    try {
      app.parse(static_cast<int>(argv.size()), argv.data());
      ADD_FAILURE() << wrong;
    } catch (const CLI::ParseError& error) {
      EXPECT_EQ(std::string(error.what()), "--size: '" + wrong + "' is not a number above zero");
    }
  }
}

TEST(Program, PicturesArePngFiles) {
  const auto error_of = [](const std::string& path) -> std::string {
    CLI::App app("", "tester");
    std::string picture;
    AddPictureOption(app, picture, "Draw it");
    try {
      app.parse("--picture '" + path + "'");
      return "";
    } catch (const CLI::ParseError& error) {
      return error.what();
    }
  };
  EXPECT_EQ(error_of("a folder/robot.png"), "");
  EXPECT_THAT(error_of("robot.jpg"), HasSubstr("'robot.jpg' is not the name of a PNG file"));
  EXPECT_THAT(error_of("robot"), HasSubstr("not the name of a PNG file"));
}

TEST(Program, VersionGoesToStandardOutput) {
  testing::internal::CaptureStdout();
  EXPECT_EQ(RunTester({"--version"}, [] { return 3; }), 0);
  EXPECT_THAT(testing::internal::GetCapturedStdout(), HasSubstr("tester 0."));
}

TEST(ProgramDeathTest, OutputThatCannotBeWrittenIsNoSuccess) {
  const auto print_to = [](int file) {
    dup2(file, STDOUT_FILENO);
    std::exit(RunTester({}, [] {
      std::cout << "an answer";
      return static_cast<int>(kDone);
    }));
  };
  EXPECT_EXIT(print_to(open("/dev/full", O_WRONLY)), testing::ExitedWithCode(kWorldFailed),
              "tester: the output could not be written; is the disk full");
  EXPECT_EXIT(
      {
        dup2(open("/dev/full", O_WRONLY), STDOUT_FILENO);
        std::exit(RunTester({"--help"}, [] { return 0; }));
      },
      testing::ExitedWithCode(kWorldFailed), "the output could not be written");
  // Who reads it has enough, as `head` has.
  EXPECT_EXIT(
      {
        std::signal(SIGPIPE, SIG_IGN);
        int ends[2] = {};
        if (pipe(ends) == 0) close(ends[0]);
        print_to(ends[1]);
      },
      testing::ExitedWithCode(kDone), "");
}

TEST(Program, ExceptionsBecomeOneSentence) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(RunTester({}, []() -> int { throw std::invalid_argument("a bad value"); }), 2);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "tester: a bad value\n");
  testing::internal::CaptureStderr();
  EXPECT_EQ(RunTester({}, []() -> int { throw std::runtime_error("no luck"); }), 3);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "tester: no luck\n");
  testing::internal::CaptureStderr();
  EXPECT_EQ(RunTester({}, []() -> int { throw std::bad_alloc(); }), 3);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "tester: there is not enough memory\n");
}

TEST(Program, NameThatIsTooLongForAFileIsTheUsersMistake) {
  const std::string path = std::string(256, 'x') + "/cell.lmdb";
  testing::internal::CaptureStderr();
  EXPECT_EQ(RunTester({}, [&]() -> int { return std::filesystem::exists(path) ? 0 : 1; }), 2);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "tester: '" + path + "': a name is too long; shorten it to 255 characters\n");
}

TEST(Program, SecondStopSignalAndAClosedTerminalHaltBeforeTheyEndTheProcess) {
  const std::vector<std::vector<int>> endings = {
      {SIGINT, SIGINT}, {SIGINT, SIGTERM}, {SIGHUP}, {SIGHUP, SIGHUP}};
  for (const std::vector<int>& signals : endings) {
    const auto send = [&] {
      std::signal(SIGHUP, SIG_DFL);  // as at a terminal
      CatchStopSignals();
      const HaltOnSignals halt([] { std::cerr << "halted" << std::endl; });
      for (const int signal : signals) std::raise(signal);
      pause();
    };
    EXPECT_EXIT(send(), testing::KilledBySignal(signals.back()), "halted");
  }
}

TEST(Program, AnotherStopSignalEndsAHaltThatTakesTooLong) {
  const auto send = [] {
    CatchStopSignals();
    const HaltOnSignals halt([] { pause(); });
    for (const int signal : {SIGINT, SIGINT, SIGTERM}) std::raise(signal);
    pause();
  };
  EXPECT_EXIT(send(), testing::KilledBySignal(SIGTERM), "^$");
}

TEST(Program, ClosedTerminalEndsWhatHasNothingToHaltUnlessThatIsIgnored) {
  const auto send = [](auto handler) {
    std::signal(SIGHUP, handler);
    CatchStopSignals();
    {
      const HaltOnSignals over([] { std::cerr << "halted" << std::endl; });
    }
    std::raise(SIGHUP);
    _exit(kDone);
  };
  EXPECT_EXIT(send(SIG_DFL), testing::KilledBySignal(SIGHUP), "^$");
  EXPECT_EXIT(send(SIG_IGN), testing::ExitedWithCode(kDone), "^$");
}

TEST(Program, StopSignalIsNoticedAndErrorsAfterItHaveAnExitCodeOfTheirOwn) {
  CatchStopSignals();
  EXPECT_FALSE(StopRequested());
  std::raise(SIGINT);
  EXPECT_TRUE(StopRequested());
  EXPECT_EQ(RunTester({}, []() -> absl::StatusOr<ExitCode> { return absl::AbortedError(""); }),
            130);
}

TEST(Progress, EndsWithALineThatTellsWhatWasDone) {
  testing::internal::CaptureStderr();
  {
    Progress progress("capture", 4, "configurations");
    progress.Update(3);
    progress.Update(4);
  }
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("capture 4 of 4 configurations (100 %), "));
}

TEST(Progress, TimeLeftDoesNotRestOnWhatAnEarlierRunDid) {
  testing::internal::CaptureStderr();
  {
    Progress progress("capture", 1000, "configurations");
    progress.Update(900, 900);
  }
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              AllOf(HasSubstr("900 of 1000 configurations (90 %)"), Not(HasSubstr("left"))));
  testing::internal::CaptureStderr();
  {
    Progress progress("capture", 1000, "configurations");
    absl::SleepFor(absl::Milliseconds(20));
    progress.Update(901, 900);
  }
  // At least 99 times 20 ms.
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              AllOf(HasSubstr(" left"), Not(HasSubstr(", 0."))));
}

// What `work` writes to stderr if that is a terminal.
std::string ShownOnATerminal(const std::function<void()>& work) {
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY);
  EXPECT_EQ(grantpt(terminal), 0);
  EXPECT_EQ(unlockpt(terminal), 0);
  const int end = open(ptsname(terminal), O_RDWR | O_NOCTTY);
  const int stderr_before = dup(STDERR_FILENO);
  dup2(end, STDERR_FILENO);
  work();
  dup2(stderr_before, STDERR_FILENO);
  for (const int file : {stderr_before, end}) close(file);
  // Each write may arrive by itself; after the last one the closed terminal ends the text.
  std::string shown;
  std::array<char, 4096> part{};
  for (ssize_t size; (size = read(terminal, part.data(), part.size())) > 0;) {
    shown.append(part.data(), static_cast<size_t>(size));
  }
  close(terminal);
  return shown;
}

TEST(Steps, TerminalShowsTheStepAndNothingInTheEnd) {
  const std::string shown = ShownOnATerminal([] {
    Steps steps("poses");
    steps.Begin("first poses");
    steps.Begin("all poses together");
  });
  EXPECT_THAT(shown, HasSubstr("poses: first poses, 0.0 s"));
  EXPECT_THAT(shown, HasSubstr("\r\033[Kposes: all poses together"));
  EXPECT_THAT(shown, testing::EndsWith("\r\033[K"));
}

TEST(Steps, ShortWorkWritesNothingIntoALog) {
  testing::internal::CaptureStderr();
  Steps("poses").Begin("first poses");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(Progress, DurationsAreSpokenAsPeopleDo) {
  EXPECT_EQ(Spoken(absl::Milliseconds(4200)), "4.2 s");
  EXPECT_EQ(Spoken(absl::Seconds(59)), "59 s");
  EXPECT_EQ(Spoken(absl::Seconds(200)), "3 min 20 s");
  EXPECT_EQ(Spoken(absl::Hours(1) + absl::Minutes(12)), "1 h 12 min");
}

}  // namespace
}  // namespace silhouette
