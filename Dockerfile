# An image for CI (docs/install.md): docker build --tag msggen . && docker run --rm --volume "$PWD:/work" msggen --help
FROM python:3.13-slim

# Debian keeps only the newest git of a release. Mounted folders belong to a user of the host.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends git \
    && rm -rf /var/lib/apt/lists/* \
    && git config --system --add safe.directory '*' \
    && useradd --create-home --uid 1000 msggen

# A wheel in the folder that is built, or the folder itself
ARG PACKAGE=.
RUN --mount=type=bind,target=/source pip install --no-cache-dir --no-compile "/source/$PACKAGE"

USER msggen
WORKDIR /work
ENTRYPOINT ["msggen"]
