// SPDX-License-Identifier: Apache-2.0
#include "server/page/page.h"

#include <arpa/inet.h>
#include <httplib.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/time/time.h"
#include "common/text/host_port.h"
#include "db/status/status_macros.h"
#include "server/gate/credentials.h"
#include "server/page/page_calls.h"
#include "server/page/snapshot.h"
#include "server/page/templates.h"
#include "server/service/defects.h"
#include "server/service/http_server.h"
#include "server/service/listener.h"

namespace silhouette {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;
using std::chrono::milliseconds;

constexpr milliseconds kLeastInterval{100};
// Without a change: ages and devices change all the same.
constexpr milliseconds kLongestInterval{500};
// After a change, the map is left to those who work it out anyway for as long as map_time and this.
constexpr milliseconds kAfterMapTime{5};
constexpr milliseconds kSilence{500};
constexpr int kNice = 10;
constexpr size_t kMostStops = 100;
constexpr std::chrono::seconds kLongestStart{10};

// When what is served changes, and when and why nothing was known. Any threads.
class Changes final : public Watcher {
 public:
  explicit Changes(Serving& serving) : serving_(serving) { NoteStop(); }

  void Tell(uint64_t version) override {
    {
      const std::lock_guard lock(mutex_);
      if (version == version_) return;
      version_ = version;
      NoteStop();
    }
    changed_.notify_all();
  }
  void End() override {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    changed_.notify_all();
  }

  struct News {
    uint64_t version = 0;
    SteadyTime at;
  };
  // Waits for a version other than that of `last`, at most kLongestInterval and at least
  // kLeastInterval after it, then until `settle` after a change. Nothing: it has ended.
  std::optional<News> Wait(const News& last, milliseconds settle) {
    std::unique_lock lock(mutex_);
    const auto ended = [&] { return ended_; };
    if (changed_.wait_until(lock, last.at + kLeastInterval, ended)) return std::nullopt;
    changed_.wait_until(lock, last.at + kLongestInterval,
                        [&] { return ended_ || version_ != last.version; });
    const News news{version_, std::chrono::steady_clock::now()};
    if (changed_.wait_until(lock, news.at + settle, ended)) return std::nullopt;
    return news;
  }

  // Newest first.
  nlohmann::json Stops() const {
    const std::lock_guard lock(mutex_);
    nlohmann::json stops = nlohmann::json::array();
    for (const Stop& stop : stops_) {
      stops.push_back({{"time", absl::ToUnixMillis(stop.time)},
                       {"reason", stop.reason == Reason::kNone ? "" : NameOf(stop.reason)},
                       {"message", stop.message}});
    }
    return stops;
  }

 private:
  struct Stop {
    absl::Time time;
    Reason reason;  // kNone: verdicts are known again
    std::string message;
  };

  // The caller holds the mutex, or is the constructor.
  void NoteStop() {
    const Moment now = serving_.settings.clock();
    const Served served = serving_.scenes.Newest(now);
    const Policy policy = DefaultPolicy(serving_.settings, *served.database);
    const Reason reason = BlockedReason(served, policy, serving_.settings.scene, now);
    if (stops_.empty() ? reason == Reason::kNone : reason == stops_.front().reason) return;
    const std::vector<SceneDefect> defects = DefectsOf(served, reason, serving_.settings, now);
    auto stated = std::ranges::find(defects, reason, &SceneDefect::reason);
    if (stated == defects.end()) stated = defects.begin();
    stops_.push_front({now.time, reason, defects.empty() ? "" : stated->message});
    if (stops_.size() > kMostStops) stops_.pop_back();
  }

  Serving& serving_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  uint64_t version_ = 0;
  bool ended_ = false;
  std::deque<Stop> stops_;
};

// Whether a Host header names an address by its number, or localhost. A name could be anybody's.
bool NamesNoForeignHost(std::string host) {
  const size_t port = host.rfind(':');
  if (port != std::string::npos && host.find(']', port) == std::string::npos) host.resize(port);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  char address[sizeof(in6_addr)];
  return host == "localhost" || inet_pton(AF_INET, host.c_str(), address) == 1 ||
         inet_pton(AF_INET6, host.c_str(), address) == 1;
}

void Refuse(httplib::Response& response, int status, const std::string& why) {
  response.status = status;
  response.set_content(why + "\n", "text/plain; charset=utf-8");
}

// Whether the page's own script asks. Neither a form nor a script of another site can send this
// type and this origin.
bool FromThisPage(const httplib::Request& request) {
  const std::string site = request.get_header_value("Sec-Fetch-Site");
  return request.get_header_value_count("Origin") == 1 &&
         request.get_header_value("Origin") == "http://" + request.get_header_value("Host") &&
         request.get_header_value("Content-Type") == "application/json" &&
         (site.empty() || site == "same-origin");
}

// A body whose length is known before it is read, and which does not grow when it is unpacked.
bool HasPlainBody(const httplib::Request& request) {
  return !request.has_header("Transfer-Encoding") && !request.has_header("Content-Encoding");
}

int HttpCodeOf(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
      return 400;
    case absl::StatusCode::kPermissionDenied:
      return 403;
    case absl::StatusCode::kAborted:
      return 409;
    case absl::StatusCode::kResourceExhausted:
      return 429;
    default:
      return 500;
  }
}

httplib::Headers SecurityHeaders() {
  return {{"Content-Security-Policy",
           "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src "
           "'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
          {"X-Content-Type-Options", "nosniff"},
          {"Referrer-Policy", "no-referrer"},
          {"Cross-Origin-Resource-Policy", "same-origin"},
          {"Cache-Control", "no-store"}};
}

std::string HtmlText(const std::string& in_header) {
  return absl::StrReplaceAll(templates::page_html, {{"<!-- replay -->", in_header}});
}

// Whether another site asks; refused then.
bool RefusesOthers(const httplib::Request& request, httplib::Response& response) {
  if (request.get_header_value("Sec-Fetch-Site") != "cross-site") return false;
  Refuse(response, 403, "Another site asks.");
  return true;
}

// Nothing: refused.
std::optional<SliceChoice> ChoiceIn(const httplib::Request& request, httplib::Response& response) {
  const absl::StatusOr<SliceChoice> choice = SliceChoiceFrom(
      request.get_param_value("x"), request.get_param_value("y"), request.get_param_value("at"));
  if (choice.ok()) return *choice;
  Refuse(response, 400, std::string(choice.status().message()));
  return std::nullopt;
}

std::string TextOf(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

struct CellPage::Http {
  // The files of the page. `in_header`: what its header has for a recording.
  explicit Http(const std::string& in_header) {
    server.new_task_queue = [] { return new BoundedThreads(kMostConnections); };
    server.set_tcp_nodelay(true);
    server.set_payload_max_length(kMostBody);
    server.set_keep_alive_max_count(1);
    // A connection that falls silent, or reads no more, holds up the end of the program for so
    // long.
    server.set_keep_alive_timeout(1);
    server.set_read_timeout(kSilence);
    server.set_write_timeout(kSilence);
    server.set_default_headers(SecurityHeaders());
    server.set_pre_routing_handler(
        [](const httplib::Request& request, httplib::Response& response) {
          if (request.get_header_value_count("Host") != 1 ||
              !NamesNoForeignHost(request.get_header_value("Host"))) {
            Refuse(response, 421, "Open this page by a numeric address or as localhost.");
          } else if (!HasPlainBody(request)) {
            Refuse(response, 411, "State the length of the body, and do not pack it.");
          } else {
            return httplib::Server::HandlerResponse::Unhandled;
          }
          return httplib::Server::HandlerResponse::Handled;
        });
    File("/", HtmlText(in_header), "text/html; charset=utf-8");
    File("/page.css", templates::page_css, "text/css; charset=utf-8");
    File("/page.js", templates::page_js, "text/javascript; charset=utf-8");
    File("/regions.js", templates::regions_js, "text/javascript; charset=utf-8");
    server.Get("/favicon.ico",
               [](const httplib::Request&, httplib::Response& response) { response.status = 204; });
  }

  ~Http() {
    if (changes != nullptr) changes->End();
    WaitForStart(kLongestStart);  // stop() does not end a server that is yet to start
    server.stop();
    if (thread.joinable()) thread.join();
  }

  void File(const std::string& path, const std::string& text, const char* type) {
    server.Get(path, [text, type](const httplib::Request&, httplib::Response& response) {
      response.set_content(text, type);
    });
  }

  // `role`: as of CellPage::Start.
  void Show(Serving& serving, std::optional<Role> role) {
    changes = std::make_shared<Changes>(serving);
    server.Get("/events", [this, &serving, role](const httplib::Request& request,
                                                 httplib::Response& response) {
      Stream(serving, role, request, response);
    });
    server.Get("/clock", [&serving](const httplib::Request& request, httplib::Response& response) {
      if (RefusesOthers(request, response)) return;
      const double clock = absl::ToDoubleSeconds(serving.settings.clock().running);
      response.set_content(TextOf({{"clock", clock}}), "application/json");
    });
    for (const char* const call : kPageCalls) {
      server.Post(call, [&serving, role, call](const httplib::Request& request,
                                               httplib::Response& response) {
        if (!FromThisPage(request)) {
          serving.AuditFirst("page " + request.remote_addr, "call.denied", call);
          return Refuse(response, 403,
                        "Only the page itself may ask: with its origin, and as application/json.");
        }
        const absl::Status done =
            AnswerPageCall(serving, role, call, request.body, request.remote_addr);
        if (!done.ok()) return Refuse(response, HttpCodeOf(done), std::string(done.message()));
        response.status = 204;
      });
    }
  }

  void Show(const Replay& replay) {
    File("/replay.js", templates::replay_js, "text/javascript; charset=utf-8");
    server.Get("/recording",
               [&replay](const httplib::Request& request, httplib::Response& response) {
                 if (RefusesOthers(request, response)) return;
                 response.set_content(TextOf(replay.TimeLine()), "application/json");
               });
    server.Get("/moment", [&replay](const httplib::Request& request, httplib::Response& response) {
      if (RefusesOthers(request, response)) return;
      int64_t time = 0;
      if (!absl::SimpleAtoi(request.get_param_value("time"), &time)) {
        return Refuse(response, 400, "time is in milliseconds since 1970");
      }
      const std::optional<SliceChoice> choice = ChoiceIn(request, response);
      if (choice) response.set_content(TextOf(replay.At(time, *choice)), "application/json");
    });
  }

  // Unavailable: it does not begin to serve.
  absl::Status Listen() {
    thread = std::thread([this] {
      // The threads that it starts are as nice as it.
      setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
      server.listen_after_bind();
      ended = true;
    });
    if (WaitForStart(kLongestStart)) return absl::OkStatus();
    return absl::UnavailableError("page: the system lets no connections come in; start it again");
  }

  // Whether it serves, before it has ended or `longest` is over.
  bool WaitForStart(std::chrono::seconds longest) const {
    const SteadyTime end = std::chrono::steady_clock::now() + longest;
    while (thread.joinable() && !ended && !server.is_running()) {
      if (std::chrono::steady_clock::now() >= end) break;
      std::this_thread::sleep_for(milliseconds(1));
    }
    return server.is_running();
  }

  // Server-sent events: a snapshot each.
  void Stream(Serving& serving, std::optional<Role> role, const httplib::Request& request,
              httplib::Response& response) {
    if (RefusesOthers(request, response)) return;
    const std::optional<SliceChoice> choice = ChoiceIn(request, response);
    if (!choice) return;
    if (streams.fetch_add(1) >= kMostStreams) {
      --streams;
      return Refuse(response, 503,
                    absl::StrCat("At most ", kMostStreams, " pages show this cell: close one."));
    }
    const milliseconds settle =
        absl::ToChronoMilliseconds(serving.settings.map_time) + kAfterMapTime;
    response.set_chunked_content_provider(
        "text/event-stream",
        [this, &serving, role, choice = *choice, settle, last = Changes::News()](
            size_t, httplib::DataSink& sink) mutable {
          const std::optional<Changes::News> news = changes->Wait(last, settle);
          if (!news) {
            sink.done();
            return true;
          }
          last = *news;
          ++snapshots;
          const std::string event = absl::StrCat("data: ",
                                                 TextOf({{"stops", changes->Stops()},
                                                         {"role", role ? NameOf(*role) : ""},
                                                         {"now", PageSnapshot(serving, choice)}}),
                                                 "\n\n");
          return sink.write(event.data(), event.size());
        },
        [this](bool) { --streams; });
  }

  std::shared_ptr<Changes> changes;  // null: of a recording
  std::atomic<bool> ended = false;   // no longer serves, or never did
  std::atomic<int> streams = 0;
  std::atomic<uint64_t> snapshots = 0;
  httplib::Server server;
  std::thread thread;
};

CellPage::CellPage(std::unique_ptr<Http> http, std::string address)
    : http_(std::move(http)), address_(std::move(address)) {}

CellPage::~CellPage() = default;

uint64_t CellPage::snapshots() const { return http_->snapshots; }

absl::StatusOr<std::unique_ptr<CellPage>> CellPage::Start(const std::string& address, bool insecure,
                                                          Serving& serving,
                                                          std::optional<Role> role) {
  if (role && CheckListenAddress(address).ok() && !StaysOnThisMachine(address)) {
    return absl::FailedPreconditionError(
        absl::StrCat("page: everyone who reaches ", address, " would have the role '",
                     NameOf(*role), "': use 127.0.0.1, and 'ssh -L' from other machines"));
  }
  auto http = std::make_unique<Http>(/*in_header=*/"");
  http->Show(serving, role);
  const std::shared_ptr<Changes> changes = http->changes;
  ASSIGN_OR_RETURN(auto page, Listen(address, insecure, std::move(http)));
  serving.watches.Add(changes);
  if (serving.settings.live != nullptr) serving.settings.live->KeepImages();
  return page;
}

absl::StatusOr<std::unique_ptr<CellPage>> CellPage::Start(const std::string& address, bool insecure,
                                                          const Replay& replay) {
  auto http = std::make_unique<Http>(templates::replay_html);
  http->Show(replay);
  return Listen(address, insecure, std::move(http));
}

absl::StatusOr<std::unique_ptr<CellPage>> CellPage::Listen(const std::string& address,
                                                           bool insecure,
                                                           std::unique_ptr<Http> http) {
  if (address.starts_with("unix:")) {
    return absl::InvalidArgumentError(
        absl::StrCat("page address '", address, "': browsers ask over TCP; say 127.0.0.1:8080"));
  }
  if (absl::Status usable = CheckListenAddress(address); !usable.ok()) {
    return absl::Status(usable.code(), absl::StrCat("page: ", usable.message()));
  }
  if (!insecure && !StaysOnThisMachine(address)) {
    return absl::FailedPreconditionError(absl::StrCat(
        "page: will not show the cell on ", address,
        ", which other machines reach: use 127.0.0.1, or start with --insecure if everyone in that "
        "network may see its images"));
  }
  const std::optional<HostPort> listened = BindServer(http->server, *ParseHostPort(address));
  if (!listened)
    return absl::FailedPreconditionError(absl::StrCat("page: cannot listen on ", address));
  RETURN_IF_ERROR(http->Listen());
  return std::unique_ptr<CellPage>(new CellPage(std::move(http), listened->Text()));
}

}  // namespace silhouette
