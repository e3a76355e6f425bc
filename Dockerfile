# syntax=docker/dockerfile:1
#
# docker build -t chladni .
# docker run -p 8080:8080 -v chladni:/data -e CHLADNI_KEYS="me:read+submit+operate:$(openssl rand -hex 24)" chladni

FROM rust:1.95-slim-trixie AS build
RUN apt-get update \
    && apt-get install -y --no-install-recommends build-essential nodejs npm \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /build
# The dependencies alone first (empty sources in place of ours): this layer is built again only when a manifest changes.
COPY Cargo.toml Cargo.lock ./
COPY crates/algebra/Cargo.toml crates/algebra/
COPY crates/base/Cargo.toml crates/base/
COPY crates/mesh/Cargo.toml crates/mesh/
COPY crates/page/Cargo.toml crates/page/
COPY crates/spectral/Cargo.toml crates/spectral/
COPY crates/work/Cargo.toml crates/work/
# Members of the workspace that the image does without: their placeholders stay.
COPY python/Cargo.toml python/
COPY tests/s3/Cargo.toml tests/s3/
RUN for folder in . crates/* python tests/s3; do \
        mkdir -p "$folder/src" "$folder/benches" && : > "$folder/src/lib.rs" \
        && sed -n '/^\[\[bench\]\]/,/^$/s/^name = "\(.*\)"/\1/p' "$folder/Cargo.toml" \
        | while read -r name; do echo 'fn main() {}' > "$folder/benches/$name.rs"; done; \
    done \
    && mkdir -p python/examples && : > python/examples/native.rs \
    && echo 'fn main() {}' | tee src/main.rs > build.rs \
    && cargo build --release --locked --bin chladni \
    && rm -rf src benches crates/*/src crates/*/benches
COPY README.md ./
COPY migrations migrations
COPY openapi openapi
COPY benches benches
# Build scripts make the web page and the manual and embed them; an image without them would be a surprise.
COPY build.rs ./
COPY build build
COPY docs docs
COPY web web
COPY crates crates
COPY src src
# Cargo looks at times of change, and those of a copied file may lie before the placeholder's.
RUN find src crates build build.rs -name '*.rs' -exec touch {} + \
    && CHLADNI_WEB=required cargo build --release --locked --bin chladni \
    && strip target/release/chladni

# What is inside: the bill of materials of the program, in CycloneDX, and the lock file of the page.
FROM build AS bill
RUN cargo install --locked cargo-cyclonedx \
    && cargo cyclonedx --format json --override-filename chladni.cdx \
    && install -D -t /bill chladni.cdx.json \
    && install -D web/package-lock.json /bill/page.package-lock.json

FROM debian:trixie-slim
RUN apt-get update \
    && apt-get install -y --no-install-recommends ca-certificates curl libvulkan1 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --uid 10001 --user-group --no-create-home --home-dir /data --shell /usr/sbin/nologin chladni \
    && install -d -o chladni -g chladni /data
COPY --from=build /build/target/release/chladni /usr/local/bin/chladni
COPY --from=bill /bill /usr/share/doc/chladni
USER chladni
WORKDIR /data
# Beyond loopback the server wants API keys: CHLADNI_KEYS, or CHLADNI_KEYS_FILE with a mounted secret.
ENV CHLADNI_DATA=/data \
    CHLADNI_LISTEN=0.0.0.0:8080 \
    CHLADNI_LOG_FORMAT=json
# Of a card that `docker run --gpus` hands over, the Vulkan driver too: docs/gpu.md.
ENV NVIDIA_DRIVER_CAPABILITIES=compute,graphics,utility
VOLUME /data
EXPOSE 8080
# SIGTERM drains: running jobs get CHLADNI_DRAIN_SECONDS, so give `docker stop` a little more.
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=3s --start-period=5s --retries=3 \
    CMD curl --fail --silent --output /dev/null http://127.0.0.1:8080/healthz || exit 1
ENTRYPOINT ["chladni"]
CMD ["serve"]
