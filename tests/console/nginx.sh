#!/usr/bin/env bash
# Runs nginx in the foreground with the configuration that we ship, as the
# proxy of a test; only files, ports and the name are others. Beside https it
# serves http, for clients that send what they like. Users, all with the
# password "correct horse": view, acknowledge, engineer, named like their
# roles, and stranger, who has none. FOLDER/proxy-secret holds the secret.
# Usage: nginx.sh FOLDER HTTPS_PORT HTTP_PORT PAGE_PORT METRICS_PORT
set -euo pipefail
site=$(dirname "$0")/../../console/nginx/fdi.conf
folder=$(realpath "$1")
PATH=$PATH:/usr/sbin
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 \
  -subj /CN=localhost -addext subjectAltName=DNS:localhost \
  -keyout "$folder/key.pem" -out "$folder/cert.pem" 2>/dev/null
hash=$(openssl passwd -6 'correct horse')
for user in view acknowledge engineer stranger; do
  echo "$user:$hash" >>"$folder/users"
  [ "$user" = stranger ] || echo "$user $user;" >>"$folder/roles"
done
echo "proxy_set_header X-FDI-Secret $(cat "$folder/proxy-secret");" >"$folder/secret"
sed "s#/etc/nginx/fdi/#$folder/#
  s#/etc/ssl/certs/valves.pem#$folder/cert.pem#
  s#/etc/ssl/private/valves.key#$folder/key.pem#
  s#server_name [^;]*#server_name localhost#
  s#listen 443 ssl#listen 127.0.0.1:$2 ssl; listen 127.0.0.1:$3#
  /listen \[::\]/d
  s#127.0.0.1:8080#127.0.0.1:$4#; s#127.0.0.1:9464#127.0.0.1:$5#" \
  "$site" >"$folder/site.conf"
cat >"$folder/nginx.conf" <<NGINX
daemon off; master_process off; pid $folder/nginx.pid;
error_log stderr warn;
events { worker_connections 512; }
http {
  access_log off;
  types { text/html html; text/css css; text/javascript js; image/svg+xml svg; }
  client_body_temp_path $folder/body; proxy_temp_path $folder/proxy;
  fastcgi_temp_path $folder/fastcgi; uwsgi_temp_path $folder/uwsgi;
  scgi_temp_path $folder/scgi;
  include $folder/site.conf;
}
NGINX
exec nginx -c "$folder/nginx.conf" -e stderr
