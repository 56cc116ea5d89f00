#pragma once

namespace fdi::cli {

/// The functions that complete from the tables, equal for all programs.
/// `program` is the word that was typed, so that a program that is not on the
/// PATH asks the fdi-store beside it.
inline constexpr const char* kCompletionScript = R"bash(
# Values of KEY in what fdi-store lists: _fdi_listed KEY ARGUMENTS...
_fdi_listed() {
  local key=$1 store=fdi-store
  shift
  [[ $program != */* ]] || store=${program%/*}/fdi-store
  timeout 2 "$store" "${data[@]}" "$@" --json 2>/dev/null |
    sed -n "s/^ *\"$key\": \"\(.*\)\",\{0,1\}\$/\1/p" | sort -u
}

# Candidates of a kind.
_fdi_candidates() {
  case $1 in
    words*) printf '%s\n' ${1#words} ;;
    fault | spec)
      printf '%s\n' f{1..19} t1 p1 p2
      ;;
    valve)
      _fdi_listed pattern valves list
      _fdi_listed valve_id history list
      _fdi_listed valve_id runs list
      ;;
    model) _fdi_listed model_set models list ;;
    run) _fdi_listed run_id runs list ;;
    type) _fdi_listed name types list ;;
    episode)
      echo last
      _fdi_listed episode_id history list --limit 100
      ;;
  esac
}

# Completes $word as a value of KIND; lists grow after their last comma.
_fdi_value() {
  local kind=$1 before= last=$word
  case $kind in
    file)
      compopt -o filenames
      mapfile -t COMPREPLY < <(compgen -f -- "$word")
      return
      ;;
    folder)
      compopt -o filenames
      mapfile -t COMPREPLY < <(compgen -d -- "$word")
      return
      ;;
    spec)
      compopt -o nospace
      if [[ $colon ]]; then
        mapfile -t COMPREPLY < <(compgen -W 'abrupt@ incipient@' -- "$word")
      else
        mapfile -t COMPREPLY < <(
          compgen -S : -W "$(_fdi_candidates spec)" -- "$word")
      fi
      return
      ;;
  esac
  if [[ $word == *,* ]]; then
    before=${word%,*},
    last=${word##*,}
  fi
  mapfile -t COMPREPLY < <(
    compgen -P "$before" -W "$(_fdi_candidates "$kind")" -- "$last")
}

# The kind of value that option $1 takes at $path or above; fails for a flag.
_fdi_kind() {
  local at=$path
  while :; do
    [[ ! ${_fdi_values["$at $1"]} ]] || {
      kind=${_fdi_values["$at $1"]}
      return 0
    }
    [[ $at == *' '* ]] || return 1
    at=${at% *}
  done
}

_fdi_complete() {
  local program=$1 word=${COMP_WORDS[COMP_CWORD]} path=${1##*/} kind=
  local i given colon= count=0 option= data=() kinds=()
  COMPREPLY=()
  [[ $word != : && ${COMP_WORDS[COMP_CWORD - 1]} != : ]] || colon=1
  [[ $word != [=:] ]] || word=
  for ((i = 1; i < COMP_CWORD; i++)); do
    given=${COMP_WORDS[i]}
    if [[ $given == [=:@] || ${COMP_WORDS[i - 1]} == [:@] ]]; then
      continue
    elif [[ $option ]]; then
      [[ $option != --data ]] || data=(--data "${given/#\~\//$HOME/}")
      option=
    elif [[ $given == -* ]]; then
      ! _fdi_kind "$given" || option=$given
    elif [[ " ${_fdi_verbs[$path]} " == *" $given "* ]]; then
      path+=" $given"
    else
      ((++count))
    fi
  done
  if [[ $colon ]]; then
    [[ $kind != spec ]] || _fdi_value spec
  elif [[ $option ]]; then
    _fdi_kind "$option"
    _fdi_value "$kind"
  elif [[ $word == -* ]]; then
    mapfile -t COMPREPLY < <(
      compgen -W "${_fdi_options[$path]} ${_fdi_options[${path%% *}]}" \
        -- "$word")
  elif [[ ${_fdi_verbs[$path]} ]]; then
    mapfile -t COMPREPLY < <(compgen -W "${_fdi_verbs[$path]}" -- "$word")
  elif [[ ${_fdi_arguments[$path]} ]]; then
    mapfile -t kinds <<<"${_fdi_arguments[$path]}"
    ((count < ${#kinds[@]})) || count=$((${#kinds[@]} - 1))
    _fdi_value "${kinds[count]}"
  fi
}
)bash";

}  // namespace fdi::cli
