# Builds with the toolchain's image, runs on a slim Debian with a software Vulkan, as a user without rights.
# docker build --target cpu makes the smaller image without Vulkan, which draws on the CPU alone.
FROM rust:1-bookworm AS build
WORKDIR /src
COPY . .
# The commit, for /version: --build-arg MESHSNAP_COMMIT=$(git rev-parse HEAD)
ARG MESHSNAP_COMMIT
# Features beside those by default, such as otel.
ARG MESHSNAP_FEATURES=""
# The caches keep downloaded and built dependencies between builds; the binary is copied out because they are no part of
# the image.
RUN --mount=type=cache,target=/usr/local/cargo/registry --mount=type=cache,target=/src/target \
    cargo build --release --locked --features "$MESHSNAP_FEATURES" --bin meshsnap && cp target/release/meshsnap /usr/local/bin/

FROM debian:bookworm-slim AS cpu
RUN useradd --system --no-create-home --shell /usr/sbin/nologin meshsnap \
    && mkdir /data && chown meshsnap /data
COPY --from=build /usr/local/bin/meshsnap /usr/local/bin/meshsnap
# The Vulkan loader complains on standard error where this is missing.
ENV XDG_RUNTIME_DIR=/tmp
# Large pages for large lists, where the kernel allows them on request (docs/operations.md, "Large pages").
ENV GLIBC_TUNABLES=glibc.malloc.hugetlb=1
# Jobs, results and stored meshes, which outlive the container where the volume does.
ENV MESHSNAP_DATA_DIR=/data
VOLUME /data
USER meshsnap
# A container must listen beyond loopback to be reached at all, and that needs a decision about keys: set
# MESHSNAP_API_KEYS, or MESHSNAP_NO_AUTH=true where the network around the container keeps strangers out.
# Without either, the server says so and does not start.
ENV MESHSNAP_LISTEN=0.0.0.0:8080
EXPOSE 8080
HEALTHCHECK --interval=10s --timeout=4s --start-period=5s --retries=3 CMD ["meshsnap", "health"]
ENTRYPOINT ["meshsnap"]
CMD ["serve"]

FROM cpu
# lavapipe, so that the GPU back-end works without a GPU; on a host with one, its driver is mounted in.
USER root
RUN apt-get update -qq \
    && apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers libvulkan1 \
    && rm -rf /var/lib/apt/lists/*
USER meshsnap
