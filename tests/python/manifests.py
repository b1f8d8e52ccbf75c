"""Checks the files of deploy/ by the schemas of Kubernetes and Compose, and prints what they set, as JSON.

Arguments: the folder deploy/.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

import kubernetes_validate
import yaml

deploy = Path(sys.argv[1])
found = {"settings": {}, "probes": [], "schemas": 0, "scalers": 0, "images": 0}

# What a server of a cluster has to be told.
SHARED = {"MESHSNAP_QUEUE", "MESHSNAP_STORE", "MESHSNAP_EPHEMERAL"}
# The variables of S3 in docs/operations.md.
S3 = {"AWS_ENDPOINT_URL", "AWS_REGION", "AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_SESSION_TOKEN"}
# KEDA has no schema here. Its documents name these keys: keda.sh/docs/2.19/scalers/nats-jetstream.
SCALER = {"natsServerMonitoringEndpoint", "account", "stream", "consumer", "lagThreshold"}
SCALER_MAY = {"activationLagThreshold", "useHttps"}
SCALED = {"scaleTargetRef", "minReplicaCount", "maxReplicaCount", "triggers"}


def add_settings(variables):
    """Notes the settings of a server. What else it is told has to be S3's."""
    others = {name for name in variables if not name.startswith("MESHSNAP_")}
    assert others <= S3, others
    found["settings"] |= {name: value for name, value in variables.items() if name not in others}


def check_pods(document):
    pod = document["spec"]["template"]["spec"]
    assert pod["securityContext"]["runAsNonRoot"] and pod["automountServiceAccountToken"] is False
    claims = {claim["metadata"]["name"] for claim in document["spec"].get("volumeClaimTemplates", [])}
    for container in pod["containers"]:
        security = container["securityContext"]
        assert security["readOnlyRootFilesystem"] and security["allowPrivilegeEscalation"] is False, security
        assert container["resources"]["limits"]["memory"]
        variables = {entry["name"]: entry.get("value") or entry["valueFrom"] for entry in container["env"]}
        add_settings(variables)
        for kind in ("startupProbe", "livenessProbe", "readinessProbe"):
            found["probes"].append(container[kind]["httpGet"]["path"])
        mounts = {mount["name"] for mount in container["volumeMounts"]}
        volumes = {volume["name"] for volume in pod["volumes"]}
        assert mounts == volumes | claims, (mounts, volumes, claims)
        if document["kind"] == "Deployment":
            assert SHARED <= set(variables) and not claims, variables
            secrets = {"MESHSNAP_QUEUE", "AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"}
            assert all("secretKeyRef" in variables[name] for name in secrets), variables


def check_scaled(document):
    spec = document["spec"]
    assert document["apiVersion"] == "keda.sh/v1alpha1" and set(spec) == SCALED, document
    # KEDA says how many there are: a number in the Deployment would be set again by each `kubectl apply`.
    deployment = yaml.safe_load((deploy / "kubernetes-cluster/deployment.yaml").read_text())
    assert spec["scaleTargetRef"] == {"name": deployment["metadata"]["name"]} and "replicas" not in deployment["spec"]
    assert 2 <= spec["minReplicaCount"] < spec["maxReplicaCount"]
    for trigger in spec["triggers"]:
        assert set(trigger) == {"type", "metadata"} and trigger["type"] == "nats-jetstream", trigger
        metadata = trigger["metadata"]
        assert SCALER <= set(metadata) <= SCALER | SCALER_MAY, metadata
        # KEDA refuses numbers and truth values.
        assert all(isinstance(value, str) for value in metadata.values()), metadata
        assert (metadata["stream"], metadata["consumer"]) == ("meshsnap-jobs", "servers")
        found["scalers"] += 1


def check_kubernetes(folder):
    for path in sorted(folder.glob("*.yaml")):
        for document in yaml.safe_load_all(path.read_text()):
            if document["kind"] == "Kustomization":
                listed = set(document["resources"])
                there = {file.name for file in folder.glob("*.yaml")} - {path.name}
                assert listed == there, (listed, there)
            elif document["kind"] == "ScaledObject":
                check_scaled(document)
            else:
                kubernetes_validate.validate(document, "1.37", strict=True)
                found["schemas"] += 1
            if document["kind"] in ("StatefulSet", "Deployment"):
                check_pods(document)


def check_nats_values(path):
    config = yaml.safe_load(path.read_text())["config"]
    assert config["jetstream"]["enabled"] and config["monitor"]["enabled"] and config["cluster"]["enabled"], config
    scaled = yaml.safe_load((path.parent.parent / "scaledobject.yaml").read_text())
    endpoint = scaled["spec"]["triggers"][0]["metadata"]["natsServerMonitoringEndpoint"]
    assert endpoint.endswith(f":{config['monitor']['port']}"), endpoint


def check_compose(path, servers):
    """Checks a file of Compose, in which the services `servers` are meshsnap."""
    compose = yaml.safe_load(path.read_text())
    for name, service in compose["services"].items():
        assert service["read_only"] and service["cap_drop"] == ["ALL"] and service["mem_limit"], service
        assert service["security_opt"] == ["no-new-privileges:true"], service
        assert set(service.get("secrets", [])) <= set(compose.get("secrets", {}))
        assert {volume.split(":")[0] for volume in service.get("volumes", [])} <= set(compose.get("volumes", {}))
        assert {config["source"] for config in service.get("configs", [])} <= set(compose.get("configs", {}))
        assert set(service.get("networks", [])) <= set(compose.get("networks", {}))
        for other, condition in service.get("depends_on", {}).items():
            checks_itself = other in servers or "healthcheck" in compose["services"][other]
            assert condition == {"condition": "service_healthy"} and checks_itself, other
        if name in servers:
            add_settings(service["environment"])
            assert (path.parent / service["build"]["context"] / "Dockerfile").is_file()
        else:
            # All of a version, so that it is the one that was tried.
            assert re.search(r":\d+\.\d+(\.\d+)?(-alpine)?$", service["image"]), service["image"]
            found["images"] += 1
    for config in compose.get("configs", {}).values():
        assert (path.parent / config["file"]).is_file(), config
    return compose


def check_cluster(path):
    compose = check_compose(path, {"server"})
    server = compose["services"]["server"]
    assert SHARED <= set(server["environment"]) and server["deploy"]["replicas"] == 2, server
    assert server["environment"]["AWS_ENDPOINT_URL"] == "http://store:8333"
    # Passwords come from outside, and there are none without them.
    for name, service in compose["services"].items():
        for variable, value in service.get("environment", {}).items():
            if "PASSWORD" in variable or "SECRET" in variable or variable == "MESHSNAP_QUEUE":
                assert re.search(r"\$\{[A-Z_]+:\?", value), (name, variable)
    nats = (path.parent / "nats.conf").read_text()
    assert "sync_interval: always" in nats and "store_dir: /data" in nats and "$QUEUE_PASSWORD" in nats
    assert "server server:8080 resolve" in (path.parent / "proxy.conf").read_text()


check_kubernetes(deploy / "kubernetes")
check_kubernetes(deploy / "kubernetes-cluster")
check_nats_values(deploy / "kubernetes-cluster/nats/values.yaml")
check_compose(deploy / "compose/compose.yml", {"meshsnap"})
check_cluster(deploy / "compose/cluster.yml")
files = sorted((deploy / "compose").glob("*.yml"))
checker = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec", *map(str, files)]
checked = subprocess.run(checker, capture_output=True, text=True)
assert checked.returncode == 0, checked.stdout + checked.stderr
found["schemas"] += len(files)

print(json.dumps(found))
