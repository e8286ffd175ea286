# docker build -t clothcombo . && docker run --rm -v "$PWD:/data" clothcombo drape --garments tee.obj -o out
FROM rust:1.95-slim-trixie AS build
WORKDIR /source
COPY . .
RUN cargo build --release --locked --bin clothcombo --bin clothcombo-train

FROM debian:trixie-slim
COPY --from=build /source/target/release/clothcombo /source/target/release/clothcombo-train /usr/local/bin/
WORKDIR /data
ENTRYPOINT ["clothcombo"]
