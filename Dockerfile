# The programs and the server (README.md, Install), in Debian:
#   docker build -t silhouette .
#   docker run --rm --network host --user "$(id -u)" -v "$PWD":/cell silhouette silhouette-server --cell cell.yaml
FROM debian:bookworm AS build
COPY . /silhouette
RUN /silhouette/tools/package

FROM debian:bookworm-slim
RUN --mount=type=bind,from=build,source=/silhouette/out/packages,target=/packages \
    apt-get update && \
    apt-get install -y --no-install-recommends /packages/silhouette_*.deb /packages/silhouette-server_*.deb && \
    rm -rf /var/lib/apt/lists/*
USER silhouette
WORKDIR /cell
