"""A simulation keeps to itself."""

import os
import socket

from chute_ros.ros.middleware import LEADS_ELSEWHERE
from chute_ros.tools.isolation import free_udp_ports, isolated_ros


def test_this_very_run_is_isolated(ros):
    assert 1 <= int(os.environ["ROS_DOMAIN_ID"]) <= 100
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert "ROS_STATIC_PEERS" not in os.environ


def test_two_at_once_get_domains_and_namespaces_of_their_own(ros, monkeypatch):
    for name in ("ROS_DOMAIN_ID", *LEADS_ELSEWHERE):
        monkeypatch.setenv(name, os.environ.get(name, ""))
    outer = os.environ["ROS_DOMAIN_ID"]
    with isolated_ros() as first:
        domain = os.environ["ROS_DOMAIN_ID"]
        assert domain != outer
        with isolated_ros() as second:
            assert os.environ["ROS_DOMAIN_ID"] not in (outer, domain)
            assert first != second
            assert not set(LEADS_ELSEWHERE) & set(os.environ)


def test_free_ports_are_free_and_different():
    ports = free_udp_ports(5)
    assert len(set(ports)) == 5
    for port in ports:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
            end.bind(("127.0.0.1", port))
