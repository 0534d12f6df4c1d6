#!/usr/bin/env bash
# Signs copies of packages as a department does, with a key that is made for this and thrown away, and looks
# whether debsig-verify takes them, and refuses one without a signature, one whose files were changed after
# it was signed, and one of another key.
#   tests/package/signed.sh PACKAGE.deb...
set -euo pipefail
work=$(mktemp -d)
export GNUPGHOME=$work/gnupg
trap 'gpgconf --kill all; rm -rf "$work"' EXIT
fail() {
  echo "signed: $*" >&2
  exit 1
}

mkdir -m 700 "$GNUPGHOME"
# By an RSA key, debsigs would have gpg sign a SHA-1, which gpg then rejects.
make_key() {
  gpg --batch --quiet --passphrase '' --quick-generate-key "$1" ed25519 sign never 2>/dev/null
  gpg --batch --with-colons --fingerprint "$1" 2>/dev/null | sed -n 's/^fpr:*\([0-9A-F]*\):$/\1/p'
}
key=$(make_key department@previz.example)
stranger=$(make_key stranger@previz.example)
mkdir -p "$work"/{policies,keyrings}/"$key"
gpg --batch --export "$key" >"$work/keyrings/$key/department.gpg"
cat >"$work/policies/$key/department.pol" <<POLICY
<?xml version="1.0"?>
<!DOCTYPE Policy SYSTEM "https://www.debian.org/debsig/1.0/policy.dtd">
<Policy xmlns="https://www.debian.org/debsig/1.0/">
  <Origin Name="department" id="$key" Description="A department that installs previzd"/>
  <Selection><Required Type="origin" File="department.gpg" id="$key"/></Selection>
  <Verification MinOptional="0"><Required Type="origin" File="department.gpg" id="$key"/></Verification>
</Policy>
POLICY
sign() { debsigs --sign=origin --default-key="$1" "$2" 2>/dev/null; }
verify() { debsig-verify --quiet --policies-dir "$work/policies" --keyrings-dir "$work/keyrings" "$1" >/dev/null; }

for package in "$@"; do
  signed=$work/$(basename "$package")
  cp "$package" "$signed"
  ! verify "$signed" || fail "$package verifies without a signature"
  sign "$key" "$signed"
  verify "$signed" || fail "$package does not verify once it is signed"
  dpkg-deb --contents "$signed" >/dev/null || fail "dpkg does not read $package once it is signed"

  # The same signature, on the same package and on one with a file more.
  (cd "$work" && ar x "$signed" _gpgorigin)
  cp "$package" "$work/same.deb"
  (cd "$work" && ar q same.deb _gpgorigin)
  verify "$work/same.deb" || fail "$package does not verify by a signature that is kept beside it"
  dpkg-deb --raw-extract "$signed" "$work/changed"
  echo >"$work/changed/usr/bin/other"
  dpkg-deb --root-owner-group -Zgzip --build "$work/changed" "$work/changed.deb" >/dev/null
  (cd "$work" && ar q changed.deb _gpgorigin)
  ! verify "$work/changed.deb" || fail "$package verifies after its files were changed"
  cp "$package" "$signed"
  sign "$stranger" "$signed"
  ! verify "$signed" || fail "$package verifies with a stranger's signature"
  rm -r "$work"/changed* "$work/_gpgorigin"
done
