// SPDX-License-Identifier: Apache-2.0
#include "server/service/metrics.h"

#include <httplib.h>
#include <prometheus/collectable.h>
#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/text/host_port.h"
#include "server/service/http_server.h"
#include "server/service/server.h"
#include "server/service/serving.h"

namespace silhouette {
namespace {

constexpr time_t kSilence = 1;  // seconds

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

class Families {
 public:
  void Counter(const std::string& name, const std::string& help, uint64_t value,
               Labels labels = {}) {
    ClientMetric metric;
    metric.label = std::move(labels);
    metric.counter.value = static_cast<double>(value);
    Add(name, help, MetricType::Counter, std::move(metric));
  }
  void Gauge(const std::string& name, const std::string& help, double value, Labels labels = {}) {
    ClientMetric metric;
    metric.label = std::move(labels);
    metric.gauge.value = value;
    Add(name, help, MetricType::Gauge, std::move(metric));
  }
  void Histogram(const std::string& name, const std::string& help, const LatencyFigures& figures,
                 Labels labels) {
    ClientMetric metric;
    metric.label = std::move(labels);
    metric.histogram.sample_count = figures.count;
    metric.histogram.sample_sum = absl::ToDoubleSeconds(figures.sum);
    for (size_t i = 0; i < figures.within.size(); ++i) {
      metric.histogram.bucket.push_back(
          {.cumulative_count = figures.within[i], .upper_bound = LatencyRecord::kBounds[i]});
    }
    metric.histogram.bucket.push_back({.cumulative_count = figures.count,
                                       .upper_bound = std::numeric_limits<double>::infinity()});
    Add(name, help, MetricType::Histogram, std::move(metric));
  }

  std::vector<MetricFamily> Take() { return std::move(families_); }

 private:
  // Metrics of one name come one after the other.
  void Add(const std::string& name, const std::string& help, MetricType type, ClientMetric metric) {
    if (families_.empty() || families_.back().name != name) {
      families_.push_back({.name = name, .help = help, .type = type, .metric = {}});
    }
    families_.back().metric.push_back(std::move(metric));
  }

  std::vector<MetricFamily> families_;
};

// A name as a label's value has it: words joined by underscores.
std::string LabelOf(std::string name) {
  std::ranges::replace(name, ' ', '_');
  return name;
}

void TellScene(const Serving& serving, Families& to) {
  to.Gauge("silhouette_build_info", "The program's version", 1,
           {{.name = "version", .value = SILHOUETTE_VERSION}});
  to.Gauge("silhouette_database_generation", "Generation of the database that is served",
           static_cast<double>(serving.scenes.database()->generation()));
  to.Gauge("silhouette_database_damaged",
           "Whether the database was found damaged since it was loaded; nothing is free then",
           serving.scenes.database()->damage().found() ? 1 : 0);
  const IndexCheck::Counts checked = serving.index_check.counts();
  to.Counter("silhouette_index_checked_bytes_total", "Bytes of the collision index verified again",
             checked.bytes);
  to.Counter("silhouette_index_compared_total",
             "Verdicts of maps that were compared with robot images", checked.compared);
  to.Gauge("silhouette_scene_max_age_seconds",
           "Age above which a scene makes nothing free: max_age",
           absl::ToDoubleSeconds(serving.settings.scene.max_age));
  const SharedScene scene = serving.scenes.Find(0);
  if (scene == nullptr) return;
  to.Counter("silhouette_scenes_total", "Scenes published since the server started", scene->id);
  to.Gauge("silhouette_scene_age_seconds", "Age of the oldest image of the newest scene",
           absl::ToDoubleSeconds(scene->AgeAt(serving.settings.clock())));
  to.Gauge("silhouette_scene_defects", "Reasons why the newest scene makes nothing free",
           static_cast<double>(scene->defects.size()));
}

// The client of all of them is bounded in number by Clients, and in length as ClientOf is.
void TellClients(const Serving& serving, Families& to) {
  const std::vector<ClientCounts> clients = serving.clients.Counts();
  const auto of = [](const ClientCounts& client) {
    return Labels{{.name = "client", .value = client.client}};
  };
  for (const ClientCounts& client : clients) {
    to.Counter("silhouette_client_calls_total", "Calls and questions of streams", client.calls,
               of(client));
  }
  for (const ClientCounts& client : clients) {
    to.Gauge("silhouette_client_connections", "Open connections", client.connections, of(client));
  }
  for (const ClientCounts& client : clients) {
    to.Gauge("silhouette_client_streams", "Open watches and streams of checks", client.streams,
             of(client));
  }
  for (const ClientCounts& client : clients) {
    for (size_t limit = 0; limit < kLimits; ++limit) {
      if (client.refused[limit] == 0) continue;
      Labels labels = of(client);
      labels.push_back({.name = "limit", .value = NameOf(static_cast<Limit>(limit))});
      to.Counter("silhouette_client_refused_total", "Calls and connections refused by a limit",
                 client.refused[limit], std::move(labels));
    }
  }
}

void TellVerdicts(const Serving& serving, Families& to) {
  serving.verdicts.ForEach([&](State state, Reason reason, uint64_t verdicts) {
    Labels labels = {{.name = "verdict", .value = NameOf(state)}};
    if (reason != Reason::kNone) {
      labels.push_back({.name = "reason", .value = LabelOf(NameOf(reason))});
    }
    to.Counter("silhouette_verdicts_total", "Verdicts on configurations and paths", verdicts,
               std::move(labels));
  });
}

void TellAcquisition(const LiveStatus& status, Families& to) {
  const auto of = [](const DeviceStatus& camera) {
    return Labels{{.name = "view", .value = camera.name}};
  };
  to.Counter("silhouette_live_scenes_total", "Scenes made of the server's own images",
             status.scenes);
  to.Counter("silhouette_live_lost_sets_total", "Sets of images of which no scene was made",
             status.lost_sets);
  for (const DeviceStatus& camera : status.cameras) {
    to.Counter("silhouette_live_images_total", "Images taken into a scene", camera.good,
               of(camera));
  }
  for (const DeviceStatus& camera : status.cameras) {
    to.Counter("silhouette_live_image_errors_total", "Times that a camera gave no usable image",
               camera.errors, of(camera));
  }
  for (const DeviceStatus& camera : status.cameras) {
    if (!camera.age) continue;
    to.Gauge("silhouette_live_image_age_seconds", "Age of the newest image",
             absl::ToDoubleSeconds(*camera.age), of(camera));
  }
  for (const DeviceStatus& camera : status.cameras) {
    to.Gauge("silhouette_live_camera_serving", "Whether the newest image is young enough",
             camera.serving ? 1 : 0, of(camera));
  }
  const DeviceStatus& robot = status.robot;
  to.Counter("silhouette_live_joints_total", "Joint values that the robot reported", robot.good);
  to.Counter("silhouette_live_joints_errors_total", "Requests for joint values that failed",
             robot.errors);
  if (robot.age) {
    to.Gauge("silhouette_live_joints_age_seconds", "Age of the newest joint values",
             absl::ToDoubleSeconds(*robot.age));
  }
  const std::string latency = "silhouette_live_latency_seconds";
  const std::string help = "From the last pixel of a set of images to what is made of it";
  to.Histogram(latency, help, status.to_masks, {{.name = "to", .value = "masks"}});
  to.Histogram(latency, help, status.to_scene, {{.name = "to", .value = "scene"}});
  to.Histogram(latency, help, status.to_map, {{.name = "to", .value = "map"}});
}

void TellVariant(const Serving& serving, Families& to) {
  const std::vector<std::string> variants = serving.scenes.database()->variants();
  const absl::StatusOr<std::string> variant =
      serving.settings.live->known_variant().OfLaterImages(variants);
  to.Gauge("silhouette_live_variant_known", "Whether it is known which variant shows the robot",
           variant.ok() ? 1 : 0);
}

class Collected : public prometheus::Collectable {
 public:
  explicit Collected(const Serving& serving) : serving_(serving) {}

  std::vector<MetricFamily> Collect() const override {
    Families families;
    TellScene(serving_, families);
    TellVerdicts(serving_, families);
    TellClients(serving_, families);
    if (serving_.settings.live != nullptr) {
      TellAcquisition(serving_.settings.live->Status(), families);
      TellVariant(serving_, families);
    }
    return families.Take();
  }

 private:
  const Serving& serving_;
};

}  // namespace

// One scrape at a time; a client that falls silent holds up the others, and the end of the program,
// for kSilence.
struct Metrics::Http {
  explicit Http(const Serving& serving) : collected(serving) {
    server.new_task_queue = [] { return new BoundedThreads(1); };
    server.set_keep_alive_max_count(1);
    server.set_keep_alive_timeout(1);
    server.set_read_timeout(kSilence);
    server.set_write_timeout(kSilence);
    server.set_payload_max_length(0);
    server.Get("/metrics", [this](const httplib::Request&, httplib::Response& response) {
      response.set_content(prometheus::TextSerializer().Serialize(collected.Collect()),
                           "text/plain; version=0.0.4; charset=utf-8");
    });
  }
  ~Http() {
    // stop() does not end a server that is yet to start.
    while (thread.joinable() && !ended && !server.is_running()) std::this_thread::yield();
    server.stop();
    if (thread.joinable()) thread.join();
  }

  void Listen() {
    thread = std::thread([this] {
      server.listen_after_bind();
      ended = true;
    });
  }

  Collected collected;
  std::atomic<bool> ended = false;
  httplib::Server server;
  std::thread thread;
};

Metrics::Metrics(std::unique_ptr<Http> http, std::string address)
    : http_(std::move(http)), address_(std::move(address)) {}

Metrics::~Metrics() = default;

absl::StatusOr<std::unique_ptr<Metrics>> Metrics::Start(const std::string& address,
                                                        const Serving& serving) {
  if (address.starts_with("unix:")) {
    return absl::InvalidArgumentError(absl::StrCat(
        "metrics address '", address, "': Prometheus asks over TCP; say 127.0.0.1:9464"));
  }
  if (absl::Status usable = CheckListenAddress(address); !usable.ok()) {
    return absl::Status(usable.code(), absl::StrCat("metrics: ", usable.message()));
  }
  auto http = std::make_unique<Http>(serving);
  const std::optional<HostPort> listened = BindServer(http->server, *ParseHostPort(address));
  if (!listened) {
    return absl::FailedPreconditionError(absl::StrCat("metrics: cannot listen on ", address));
  }
  http->Listen();
  return std::unique_ptr<Metrics>(new Metrics(std::move(http), listened->Text()));
}

}  // namespace silhouette
