# Builds with the toolchain's image, runs on a slim Debian with a software Vulkan, as a user without rights.
FROM rust:1-bookworm AS build
WORKDIR /src
# The dependencies alone first: they change rarely, and this layer is then reused.
COPY Cargo.toml Cargo.lock ./
RUN mkdir -p src tests/suite tests/bench \
    && echo 'fn main() {}' | tee src/main.rs tests/bench/load.rs > tests/suite/main.rs && touch src/lib.rs \
    && cargo build --release --locked && rm -rf src tests
COPY . .
# Cargo looks at modification times, and the real files may be older than the empty ones just built.
RUN find src shaders -type f -exec touch {} + && cargo build --release --locked

FROM debian:bookworm-slim
# lavapipe, so that the GPU back-end works without a GPU; on a host with one, its driver is mounted in.
RUN apt-get update -qq \
    && apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers libvulkan1 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --system --no-create-home --shell /usr/sbin/nologin meshsnap
COPY --from=build /src/target/release/meshsnap /usr/local/bin/meshsnap
USER meshsnap
# A container must listen beyond loopback to be reached at all, and that needs a decision about keys: set
# MESHSNAP_API_KEYS, or MESHSNAP_NO_AUTH=true where the network around the container keeps strangers out.
# Without either, the server says so and does not start.
ENV MESHSNAP_LISTEN=0.0.0.0:8080
EXPOSE 8080
HEALTHCHECK --interval=10s --timeout=4s --start-period=5s --retries=3 CMD ["meshsnap", "health"]
ENTRYPOINT ["meshsnap"]
CMD ["serve"]
