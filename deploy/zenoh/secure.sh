#!/usr/bin/env bash
# Certificates and a router file for cells that trust nobody else on their network:
#
#     deploy/zenoh/secure.sh DIR ROUTER CELL...
#
# ROUTER is the name or the IP address at which the cells reach the router. DIR gets a certificate authority, a
# certificate for the router, for each cell and for the fleet host, and `router.json5` for `zenohd -c`. A cell can say
# and hear only what is under its own name, the fleet host everything. Run it again with more cells to add them:
# what is there already stays. Keep DIR/ca.key away from the plant's network; copy to each host only its own files.
#
# For a trial. A plant that has an authority of its own uses that, with the cell's name as the common name.
set -euo pipefail

[ $# -ge 3 ] || { sed -n '2,11s/^# \{0,1\}//p' "$0" >&2; exit 2; }
dir=$1 router=$2
shift 2
days=365
for name in "$@"; do
    [[ $name =~ ^[A-Za-z0-9][A-Za-z0-9_-]*$ && $name != fleet && $name != router ]] ||
        { echo "error: \`$name\` cannot be the name of a cell here" >&2; exit 2; }
done
umask 077
mkdir -p "$dir"
cd "$dir"

[ -f ca.key ] || openssl req -x509 -newkey rsa:3072 -noenc -days $((10 * days)) -keyout ca.key -out ca.pem \
    -subj "/CN=tauscope trial authority" -addext "keyUsage=critical,keyCertSign,cRLSign" 2>/dev/null

# certificate NAME [SUBJECT ALTERNATIVE NAME]
certificate() {
    [ ! -f "$1.pem" ] || return 0
    openssl req -newkey rsa:3072 -noenc -keyout "$1.key" -out "$1.csr" -subj "/CN=$1" 2>/dev/null
    {
        echo "subjectAltName=${2:-DNS:$1}"
        echo "extendedKeyUsage=serverAuth,clientAuth"
        echo "basicConstraints=critical,CA:FALSE"
    } >"$1.ext"
    openssl x509 -req -in "$1.csr" -CA ca.pem -CAkey ca.key -CAcreateserial -days $days -extfile "$1.ext" \
        -out "$1.pem" 2>/dev/null
    rm "$1.csr" "$1.ext"
}

if [[ $router =~ ^[0-9.]+$ || $router == *:* ]]; then
    certificate router "IP:$router"
else
    certificate router "DNS:$router"
fi
certificate fleet
for name in "$@"; do certificate "$name"; done

# All cells that have a certificate by now.
cells=()
for file in *.pem; do
    case ${file%.pem} in ca | router | fleet) ;; *) cells+=("${file%.pem}") ;; esac
done

# Wildcards match no chunk that begins with `@`: the cell's presence and what its streams need are named.
every='"put", "delete", "declare_subscriber", "query", "declare_queryable", "reply", "liveliness_token",
        "declare_liveliness_subscriber", "liveliness_query"'
keys() {
    echo -n "\"$1/**\", \"$1/@alive/**\", \"$1/**/@all/**\", \"$1/**/@newest/**\","
    echo " \"$1/**/@from/**\", \"$1/**/@taken/**\""
}
rule() {
    cat <<RULE
      { id: "$1", permission: "allow", flows: ["ingress", "egress"], key_exprs: [$(keys "$2")],
        messages: [$every] },
RULE
}
{
    cat <<HEAD
// A Zenoh router that admits those with a certificate of this authority and lets each cell speak under its own name
// only. Made by deploy/zenoh/secure.sh; start it with \`zenohd -c router.json5\` in this folder.
{
  mode: "router",
  listen: { endpoints: ["tls/0.0.0.0:7448"] },
  scouting: { multicast: { enabled: false }, gossip: { enabled: false } },
  transport: {
    unicast: { max_sessions: 10000, accept_pending: 1000 },
    shared_memory: { enabled: false },
    link: {
      tls: {
        root_ca_certificate: "ca.pem",
        listen_private_key: "router.key",
        listen_certificate: "router.pem",
        enable_mtls: true,
        close_link_on_expiration: true,
      },
    },
  },
  access_control: {
    enabled: true,
    default_permission: "deny",
    rules: [
HEAD
    rule fleet '*'
    for name in "${cells[@]}"; do rule "$name" "$name"; done
    echo '    ],'
    echo '    subjects: ['
    for name in fleet "${cells[@]}"; do echo "      { id: \"$name\", cert_common_names: [\"$name\"] },"; done
    echo '    ],'
    echo '    policies: ['
    for name in fleet "${cells[@]}"; do echo "      { rules: [\"$name\"], subjects: [\"$name\"] },"; done
    echo '    ],'
    echo '  },'
    echo '}'
} >router.json5
echo "$PWD/router.json5: ${#cells[@]} cells. An endpoint of the cell \`${cells[0]}\`:"
echo "tls/$router:7448#root_ca_certificate_file=ca.pem;enable_mtls=true;connect_certificate_file=${cells[0]}.pem;connect_private_key_file=${cells[0]}.key"
