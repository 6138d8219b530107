# docker build -t phyblock .
# docker run --rm -v "$PWD:/work" -v phyblock-cache:/cache phyblock run quick
FROM python:3.13-slim
WORKDIR /opt/phyblock
COPY requirements.lock ./
RUN pip install --no-cache-dir --only-binary :all: --require-hashes --requirement requirements.lock
COPY . ./
RUN pip install --no-cache-dir --no-deps .
# Pictures and replies outlive the container in a volume; anybody may write, as with --user.
ENV PHYBLOCK_CACHE=/cache
RUN mkdir --mode=1777 /cache
WORKDIR /work
ENTRYPOINT ["phyblock"]
CMD ["--help"]
