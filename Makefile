# cuspline: `make` sets up and builds every design, `make test` runs the whole suite, `make help` lists the rest
SHELL := /bin/sh
.SUFFIXES:
.DELETE_ON_ERROR:
PYTHON ?= python3
BIN := .venv/bin
